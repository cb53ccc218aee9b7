# SPDX-License-Identifier: Apache-2.0
"""Decode all messages of a topic as arrays, column by column where their layout is constant."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats, Integers
from intent_recognition.bags.cdr.layout import MOST_LAYOUTS, Layout, find_layout, header_stamps_ns
from intent_recognition.bags.mcap.chunk import MessageTable, payloads

POSE = "geometry_msgs/msg/PoseStamped"
JOINT_STATE = "sensor_msgs/msg/JointState"
COLUMNS = {
    POSE: ("pose.position", "pose.orientation"),
    JOINT_STATE: ("position", "velocity", "effort"),
}
"""Numeric fields read as columns, by message type."""


@dataclass(frozen=True)
class PoseColumns:
    """The PoseStamped messages of a topic in the order of log time."""

    log_times_ns: Integers  # int64 (T,)
    stamps_ns: Integers  # of the headers, int64 (T,)
    frame_ids: tuple[str, ...]  # frames of the headers, possibly with repetitions
    frames: Integers  # index into `frame_ids` for each message, int64 (T,)
    positions: Floats  # (T, 3), in the unit of the recording, usually metres
    orientations: Floats  # (T, 4) xyzw


class JointPart(NamedTuple):
    """The messages of a topic that name the same joints and fill the same fields."""

    rows: Integers  # indices of these messages among the topic's, int64 (n,)
    frame_id: str
    names: tuple[str, ...]
    position: Floats  # (n, J); J is 0 for an empty field and may differ from the number of names
    velocity: Floats  # (n, J)
    effort: Floats  # (n, J)


@dataclass(frozen=True)
class JointColumns:
    """The JointState messages of a topic in the order of log time."""

    log_times_ns: Integers  # int64 (T,)
    stamps_ns: Integers  # of the headers, int64 (T,)
    # one for each layout; several if, for example, arm and gripper share the topic
    parts: tuple[JointPart, ...]


Columns = PoseColumns | JointColumns


_Part = tuple[Integers, list[Floats]]
"""Messages of one layout: their indices among the topic's messages, and each field's values."""


class ColumnsBuilder:
    """Collects the messages of one topic block by block."""

    def __init__(self, type_name: str):
        self._type = type_name
        self._layouts: list[Layout] = []
        self._pieces: list[_Piece] = []
        self._count = 0

    def add(self, file: int, table: MessageTable) -> bool:
        """Add the messages of a block, in file order, from the file or file group number `file`.

        Returns:
            False if a message cannot be read as columns; the builder is unusable then.
        """
        if self._type not in COLUMNS:
            return False
        numbers = self._count + np.arange(table.starts.size)
        self._count += table.starts.size
        first = int(table.lengths[0]) if numbers.size else 0
        if np.all(table.lengths == first):
            return self._add_equal(file, table, numbers, payloads(table, first))
        for length in np.unique(table.lengths).tolist():
            chosen = table.lengths == length
            part = table.rows(chosen)
            if not self._add_equal(file, part, numbers[chosen], payloads(part, length)):
                return False
        return True

    def columns(self) -> Columns:
        """All added messages, ordered by log time within each file or file group."""
        pieces = self._pieces
        numbers = _join([piece.numbers for piece in pieces])
        log_times_ns = _join([piece.log_times_ns for piece in pieces])
        stamps_ns = _join([piece.stamps_ns for piece in pieces])
        sizes = [piece.numbers.size for piece in pieces]
        files = np.repeat(np.array([piece.file for piece in pieces], np.int64), sizes)
        layouts = np.repeat(np.array([piece.layout for piece in pieces], np.int64), sizes)
        order = np.lexsort((numbers, log_times_ns, files))
        log_times_ns, stamps_ns, layouts = log_times_ns[order], stamps_ns[order], layouts[order]
        parts: list[_Part] = []
        for index in range(len(self._layouts)):
            rows = np.flatnonzero(layouts == index)
            # `order` sorts the messages of all layouts; its ranks sort those of this layout.
            ranks = np.argsort(np.argsort(order[rows]))
            own_values = [piece.values for piece in pieces if piece.layout == index]
            parts.append((rows, [_join(one)[ranks] for one in zip(*own_values, strict=True)]))
        if self._type == JOINT_STATE:
            return self._joints(log_times_ns, stamps_ns, parts)
        return self._poses(log_times_ns, stamps_ns, layouts, parts)

    def _add_equal(
        self, file: int, table: MessageTable, numbers: Integers, messages: NDArray[np.uint8]
    ) -> bool:
        """Add messages of one length, uint8 (n, length); False if one cannot be read as columns."""
        open_rows = np.arange(len(messages))
        index = 0
        while open_rows.size:
            if index == len(self._layouts) and not self._new_layout(messages[open_rows[0]]):
                return False
            layout = self._layouts[index]
            if len(layout.template) == messages.shape[1]:
                whole = open_rows.size == len(messages)
                left = messages if whole else messages[open_rows]
                hit = layout.fit(left)
                rows = open_rows[hit]
                if rows.size:
                    found = left if hit.all() else left[hit]
                    piece = _Piece(
                        numbers[rows],
                        table.log_times_ns[rows].astype(np.int64),
                        header_stamps_ns(found),
                        tuple(layout.columns(found, field) for field in COLUMNS[self._type]),
                        file,
                        index,
                    )
                    self._pieces.append(piece)
                    open_rows = open_rows[~hit]
            index += 1
        return True

    def _new_layout(self, message: NDArray[np.uint8]) -> bool:
        try:
            layout = find_layout(self._type, message.tobytes())
        except ValueError:  # the general decoder reports the reason
            return False
        if layout.tail > 3 or len(self._layouts) == MOST_LAYOUTS:  # padding
            return False
        self._layouts.append(layout)
        return True

    def _joints(self, log_times_ns: Integers, stamps_ns: Integers, parts: list[_Part]) -> Columns:
        named = [
            JointPart(rows, layout.texts["header.frame_id"][0], layout.texts["name"], *values)
            for layout, (rows, values) in zip(self._layouts, parts, strict=True)
        ]
        return JointColumns(log_times_ns, stamps_ns, tuple(named))

    def _poses(
        self, log_times_ns: Integers, stamps_ns: Integers, layouts: Integers, parts: list[_Part]
    ) -> Columns:
        if len(parts) == 1:
            ((_, (positions, orientations)),) = parts
        else:
            positions, orientations = np.empty((stamps_ns.size, 3)), np.empty((stamps_ns.size, 4))
            for rows, values in parts:
                positions[rows], orientations[rows] = values
        frame_ids = tuple(layout.texts["header.frame_id"][0] for layout in self._layouts)
        return PoseColumns(log_times_ns, stamps_ns, frame_ids, layouts, positions, orientations)


class _Piece(NamedTuple):
    """Messages of one block and one layout, in recorded order."""

    numbers: Integers
    log_times_ns: Integers
    stamps_ns: Integers
    values: tuple[Floats, ...]
    file: int
    layout: int


def _join(arrays: Sequence[NDArray]) -> NDArray:
    return np.concatenate(arrays) if arrays else np.empty(0, np.int64)

# SPDX-License-Identifier: Apache-2.0
"""All messages of a topic as arrays: decoded by whole columns where their layout is constant."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.bags.cdr.layout import Layout, layout_of
from intent_recognition.bags.mcap.chunk import MessageTable, payloads

POSE = "geometry_msgs/msg/PoseStamped"
JOINT_STATE = "sensor_msgs/msg/JointState"
MOST_LAYOUTS = 16
"""A topic that changes its texts or lengths more often is read message by message."""
LATEST_NS = 2**63 - 1


@dataclass(frozen=True)
class PoseColumns:
    """The PoseStamped messages of a topic in the order of log time.

    Attributes:
        log_times_ns: int64 (T,).
        stamps_ns: of the headers, int64 (T,).
        frame_ids: frames of the headers; one may stand here twice.
        frames: index into `frame_ids` of each message, int64 (T,).
        positions: (T, 3), in the unit of the recording, metres by convention.
        orientations: (T, 4) xyzw.
    """

    log_times_ns: np.ndarray
    stamps_ns: np.ndarray
    frame_ids: tuple[str, ...]
    frames: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray


class JointPart(NamedTuple):
    """Those messages of a topic that name the same joints and fill the same fields.

    Attributes:
        rows: which of the topic's messages these are, int64 (n,).
        frame_id: of the header.
        names: joint names as recorded.
        position: (n, J); J is 0 where the field is empty, and need not be the number of names.
        velocity: (n, J).
        effort: (n, J).
    """

    rows: np.ndarray
    frame_id: str
    names: tuple[str, ...]
    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class JointColumns:
    """The JointState messages of a topic in the order of log time.

    Attributes:
        log_times_ns: int64 (T,).
        stamps_ns: of the headers, int64 (T,).
        parts: one for each layout; several where, say, arm and gripper share the topic.
    """

    log_times_ns: np.ndarray
    stamps_ns: np.ndarray
    parts: tuple[JointPart, ...]


Columns = PoseColumns | JointColumns


class ColumnsBuilder:
    """Collects the messages of one topic block by block.

    Args:
        type_name: of all messages.
    """

    def __init__(self, type_name: str):
        self._type = type_name
        self._layout_of = layout_of(type_name)
        self._layouts: list[Layout] = []
        self._pieces: list[_Piece] = []
        self._count = 0

    def add(self, file: int, table: MessageTable) -> bool:
        """Take in the messages of a block of the `file`-th file, in file order.

        Returns:
            False if one of them is not for columns; the builder is of no use then.
        """
        if self._layout_of is None or np.any(table.log_times_ns > LATEST_NS):
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
        """Everything added, in the order of log time within each file."""
        numbers, log_times_ns, stamps_ns = (
            _join([piece[k] for piece in self._pieces]) for k in range(3)
        )
        files, layouts = (
            np.repeat(
                np.array([getattr(piece, name) for piece in self._pieces], np.int64),
                [piece.numbers.size for piece in self._pieces],
            )
            for name in ("file", "layout")
        )
        order = _order(files, log_times_ns, numbers)
        if order is not None:
            log_times_ns, stamps_ns, layouts = log_times_ns[order], stamps_ns[order], layouts[order]
        parts = []
        for index in range(len(self._layouts)):
            pieces = [p for p in self._pieces if p.layout == index]
            rows = np.flatnonzero(layouts == index)
            # The order is that among the messages of all layouts; of these alone, their ranks.
            own = None if order is None else np.argsort(np.argsort(order[rows]))
            values = [_join(arrays) for arrays in zip(*(p.values for p in pieces), strict=True)]
            parts.append((rows, *(v if own is None else v[own] for v in values)))
        if self._type == JOINT_STATE:
            return self._joints(log_times_ns, stamps_ns, parts)
        return self._poses(log_times_ns, stamps_ns, layouts, parts)

    def _add_equal(
        self, file: int, table: MessageTable, numbers: np.ndarray, messages: np.ndarray
    ) -> bool:
        """Messages of one length, uint8 (n, length)."""
        open_rows = np.arange(len(messages))
        index = 0
        while open_rows.size:
            if index == len(self._layouts) and not self._new_layout(messages[open_rows[0]]):
                return False
            layout = self._layouts[index]
            if layout.template.size == messages.shape[1]:
                whole = open_rows.size == len(messages)
                left = messages if whole else messages[open_rows]
                hit = layout.matches(left)
                rows = open_rows[hit]
                if rows.size:
                    found = left if hit.all() else left[hit]
                    piece = _Piece(
                        numbers[rows],
                        table.log_times_ns[rows].astype(np.int64),
                        layout.stamps_ns(found),
                        layout.values(found),
                        file,
                        index,
                    )
                    self._pieces.append(piece)
                    open_rows = open_rows[~hit]
            index += 1
        return True

    def _new_layout(self, message: np.ndarray) -> bool:
        layout = self._layout_of(message.tobytes())
        if layout is None or len(self._layouts) == MOST_LAYOUTS:
            return False
        self._layouts.append(layout)
        return True

    def _joints(self, log_times_ns, stamps_ns, parts) -> JointColumns:
        named = (
            JointPart(rows, layout.frame_id, layout.names, *values)
            for layout, (rows, *values) in zip(self._layouts, parts, strict=True)
        )
        return JointColumns(log_times_ns, stamps_ns, tuple(named))

    def _poses(self, log_times_ns, stamps_ns, layouts, parts) -> PoseColumns:
        if len(parts) == 1:
            _, positions, orientations = parts[0]
        else:
            positions, orientations = np.empty((stamps_ns.size, 3)), np.empty((stamps_ns.size, 4))
            for rows, *values in parts:
                positions[rows], orientations[rows] = values
        frame_ids = tuple(layout.frame_id for layout in self._layouts)
        return PoseColumns(log_times_ns, stamps_ns, frame_ids, layouts, positions, orientations)


class _Piece(NamedTuple):
    """Messages of one block and one layout, as they were recorded."""

    numbers: np.ndarray
    log_times_ns: np.ndarray
    stamps_ns: np.ndarray
    values: tuple[np.ndarray, ...]
    file: int
    layout: int


def _join(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate(arrays) if arrays else np.empty(0, np.int64)


def _order(files: np.ndarray, log_times_ns: np.ndarray, numbers: np.ndarray) -> np.ndarray | None:
    """Indices that sort by file, log time and number; None if they are sorted already."""
    later = (np.diff(files) > 0) | (np.diff(log_times_ns) >= 0)
    if np.all(later) and np.all(np.diff(numbers) > 0):
        return None
    return np.lexsort((numbers, log_times_ns, files))

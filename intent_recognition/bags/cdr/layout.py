# SPDX-License-Identifier: Apache-2.0
"""Where the numbers of a PoseStamped or JointState stand in its CDR bytes (little endian)."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

LITTLE_ENDIAN = b"\x00\x01"
COUNT = struct.Struct("<I")
ORIGIN = 4
"""Length of the encapsulation header; alignment counts from behind it."""
STAMP = slice(4, 12)
LONGEST_TAIL = 3
"""Bytes of padding a message may end with."""


@dataclass(frozen=True)
class Layout:
    """What messages with their numbers in the same places have in common.

    Attributes:
        template: one such message, uint8 (L,).
        spans: (start, stop) of the bytes that make the layout: lengths, counts and texts.
        frame_id: of the header.
        names: joint names; empty for a pose.
        arrays: (start, count) of each run of float64.
    """

    template: np.ndarray
    spans: tuple[tuple[int, int], ...]
    frame_id: str
    names: tuple[str, ...]
    arrays: tuple[tuple[int, int], ...]

    def matches(self, messages: np.ndarray) -> np.ndarray:
        """Which of the messages, uint8 (n, L), have this layout; bool (n,)."""
        if all(self._same(messages, *stretch) for stretch in self._stretches):
            return np.ones(len(messages), bool)
        return ~np.any((messages != self.template) & self._decisive, axis=1)

    def stamps_ns(self, messages: np.ndarray) -> np.ndarray:
        """Stamps of the headers, int64 (n,)."""
        stamps = np.array(messages[:, STAMP], order="C")
        seconds, nanoseconds = stamps.view("<i4")[:, 0], stamps.view("<u4")[:, 1]
        return seconds.astype(np.int64) * 1_000_000_000 + nanoseconds

    def values(self, messages: np.ndarray) -> tuple[np.ndarray, ...]:
        """The float64 (n, count) of each run, bit for bit."""
        return tuple(
            np.array(messages[:, start : start + 8 * count], order="C").view("<f8")
            if count
            else np.empty((len(messages), 0))
            for start, count in self.arrays
        )

    def _same(self, messages: np.ndarray, start: int, stop: int) -> bool:
        """Whether these bytes are the template's in all messages."""
        width, expected = stop - start, self.template[start:stop]
        if width in (2, 4):  # many rows of a few bytes are compared faster as one number each
            kind = f"<u{width}"
            return bool(np.all(messages[:, start:stop].view(kind) == expected.view(kind)))
        return bool(np.all(messages[:, start:stop] == expected))

    @cached_property
    def _decisive(self) -> np.ndarray:
        mask = np.zeros(self.template.size, bool)
        for start, stop in self.spans:
            mask[start:stop] = True
        return mask

    @cached_property
    def _stretches(self) -> list[list[int]]:
        """The spans, those joined that only padding parts: as a rule that is the same too."""
        joined: list[list[int]] = []
        for start, stop in self.spans:
            if joined and start - joined[-1][1] < ORIGIN:
                joined[-1][1] = stop
            else:
                joined.append([start, stop])
        return joined


def layout_of(type_name: str) -> Callable[[bytes], Layout | None] | None:
    """Function from a message to its layout; None for types without one."""
    return {
        "geometry_msgs/msg/PoseStamped": _pose_stamped,
        "sensor_msgs/msg/JointState": _joint_state,
    }.get(type_name)


def _pose_stamped(data: bytes) -> Layout | None:
    return _parse(data, lambda cursor: ((), (cursor.doubles(3), cursor.doubles(4))))


def _joint_state(data: bytes) -> Layout | None:
    def fields(cursor: "_Cursor"):
        names = tuple(cursor.text() for _ in range(cursor.count()))
        return names, tuple(cursor.doubles(cursor.count()) for _ in range(3))

    return _parse(data, fields)


def _parse(data: bytes, fields: Callable[["_Cursor"], tuple]) -> Layout | None:
    """Header, then fields; None for whatever a general decoder had better look at."""
    if data[: len(LITTLE_ENDIAN)] != LITTLE_ENDIAN:
        return None
    cursor = _Cursor(data)
    try:
        frame_id = cursor.text()
        names, arrays = fields(cursor)
    except (struct.error, ValueError):  # too short, or no UTF-8
        return None
    if not 0 <= len(data) - cursor.at <= LONGEST_TAIL:
        return None
    template = np.frombuffer(data, np.uint8)
    return Layout(template, tuple(cursor.spans), frame_id, names, arrays)


class _Cursor:
    """Goes through a message behind its stamp and notes what decides the layout."""

    def __init__(self, data: bytes):
        self.data = data
        self.at = STAMP.stop
        self.spans = [(0, len(LITTLE_ENDIAN))]

    def count(self) -> int:
        self.at += (ORIGIN - self.at) % COUNT.size
        (count,) = COUNT.unpack_from(self.data, self.at)
        self._advance(COUNT.size)
        return count

    def text(self) -> str:
        length = self.count()
        content = self.data[self.at : self.at + max(length - 1, 0)]
        self._advance(length)
        return content.decode()

    def doubles(self, count: int) -> tuple[int, int]:
        if count:
            self.at += (ORIGIN - self.at) % 8
        start = self.at
        self.at += 8 * count
        if self.at > len(self.data):
            raise ValueError(f"{count} numbers in a message of {len(self.data)} bytes")
        return start, count

    def _advance(self, size: int) -> None:
        self.spans.append((self.at, self.at + size))
        self.at += size
        if self.at > len(self.data):
            raise ValueError(f"{size} bytes of text in a message of {len(self.data)}")

# SPDX-License-Identifier: Apache-2.0
"""The layout of a message: offsets of its numbers and texts in the CDR bytes (little endian).

CDR aligns each number to its own size, counted from the end of the encapsulation header. A string
is its length and its bytes with a final zero; a sequence is its count and its elements. Counts and
lengths thus determine all offsets: messages with equal counts and lengths share a layout.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from intent_recognition.array_types import Flags, Integers

LITTLE_ENDIAN = b"\x00\x01"
"""First two bytes of the encapsulation header of a little-endian message."""
MOST_LAYOUTS = 16
"""Most layouts kept for one topic; only constantly changing texts or lengths give more."""
ORIGIN = 4
"""Length of the encapsulation header [bytes]; alignment is counted from its end."""
STAMP, BIG_ENDIAN_STAMP = struct.Struct("<iI"), struct.Struct(">iI")
"""Header stamp at the start of every stamped message: seconds and nanoseconds."""
COUNT = struct.Struct("<I")
"""Number of elements of a sequence, or of bytes of a string."""
NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""
NUMBERS = "bool byte char int8 uint8 int16 uint16 int32 uint32 int64 uint64 float32 float64"
FORMATS = {kind: f"<{code}" for kind, code in zip(NUMBERS.split(), "?BBbBhHiIqQfd", strict=True)}
"""Format codes of `struct` and numpy by number type in message definitions."""


@cache
def message_fields() -> Mapping[str, tuple[object, Sequence[tuple[str, tuple[int, Any]]]]]:
    """Constants and fields, as (name, (node type, detail)), of each Jazzy message type.

    Importing Jazzy's definitions also imports those of all earlier distributions, so they are
    imported only when a bag is read.
    """
    from rosbags.typesys.stores.ros2_jazzy import FIELDDEFS

    return FIELDDEFS


class NumberRun(NamedTuple):
    """Successive numbers without padding between them."""

    start: int  # offset of the first number in the message [bytes]
    dtype: str  # format code of each number, such as "<d"
    length: int  # number of numbers

    @property
    def size(self) -> int:
        """Size of one number [bytes]."""
        return struct.calcsize(self.dtype)

    @property
    def stop(self) -> int:
        """Offset of the end of the last number [bytes]."""
        return self.start + self.length * self.size


@dataclass(frozen=True)
class Layout:
    """Offsets and texts shared by messages whose numbers are at the same offsets."""

    template: bytes  # one message of this layout
    # (start, stop) of the bytes that must be equal: lengths, counts and texts
    decisive: tuple[tuple[int, int], ...]
    # numbers by field, such as "pose.position.x", "position" or "points[2].positions"; also a
    # nested message, such as "pose.position", if its numbers have no gaps between them
    runs: Mapping[str, NumberRun]
    texts: Mapping[str, tuple[str, ...]]  # strings by field; a single string is a tuple of one
    tail: int  # number of bytes after the last field

    def fits(self, data: bytes) -> bool:
        """Whether a message has this layout, with equal padding between decisive fields."""
        if len(data) != len(self.template):
            return False
        for where, expected in self._expected:  # noqa: SIM110, twice as fast as all()
            if data[where] != expected:
                return False
        return True

    def fit(self, messages: NDArray[np.uint8]) -> Flags:
        """Mask (n,) of the messages (n, L) that have this layout."""
        if all(self._same(messages, where) for where, _ in self._expected):
            return np.ones(len(messages), bool)
        return ~np.any((messages != self._bytes) & self._mask, axis=1)

    def values(self, data: bytes, field: str) -> NDArray:
        """Numbers (count,) of a field in one message of this layout, as a view of `data`."""
        start, dtype, length = self.runs[field]
        return np.frombuffer(data, dtype, length, start)

    def columns(self, messages: NDArray[np.uint8], field: str) -> NDArray:
        """Numbers (n, count) of a field in messages (n, L) of this layout, bit for bit."""
        run = self.runs[field]
        if not run.length:
            return np.empty((len(messages), 0), run.dtype)
        return np.array(messages[:, run.start : run.stop], order="C").view(run.dtype)

    def _same(self, messages: NDArray[np.uint8], where: slice) -> bool:
        """Whether these bytes equal the template's in all messages."""
        expected = self._bytes[where]
        if expected.size in (2, 4):  # comparing one number per row is faster than a few bytes
            dtype = f"<u{expected.size}"
            return bool(np.all(messages[:, where].view(dtype) == expected.view(dtype)))
        return bool(np.all(messages[:, where] == expected))

    @cached_property
    def _bytes(self) -> NDArray[np.uint8]:
        return np.frombuffer(self.template, np.uint8)

    @cached_property
    def _mask(self) -> Flags:
        mask = np.zeros(len(self.template), bool)
        for start, stop in self.decisive:
            mask[start:stop] = True
        return mask

    @cached_property
    def _expected(self) -> tuple[tuple[slice, bytes], ...]:
        """Decisive bytes, joined where only padding lies between them."""
        joined: list[list[int]] = []
        for start, stop in self.decisive:
            if joined and start - joined[-1][1] < COUNT.size:
                joined[-1][1] = stop
            else:
                joined.append([start, stop])
        return tuple((slice(*span), self.template[slice(*span)]) for span in joined)


class LayoutCache:
    """Layouts of the messages of one topic, usually a single one."""

    def __init__(self, type_name: str, most: int = MOST_LAYOUTS):
        self._type, self._most = type_name, most
        self._layouts: list[Layout] = []

    def layout_of(self, data: bytes) -> Layout:
        """The layout of a message; raises the errors of `find_layout`."""
        for layout in self._layouts:
            if layout.fits(data):
                return layout
        layout = find_layout(self._type, data)
        if len(self._layouts) < self._most:
            self._layouts.append(layout)
        return layout


def find_layout(type_name: str, data: bytes) -> Layout:
    """The layout of a serialized message.

    Raises:
        ValueError: the message is not little endian, ends too early or holds a text that is not
            UTF-8, or its type has fields other than numbers and strings.
    """
    cursor = _Cursor(data)
    cursor.message(type_name, "")
    tail = len(data) - cursor.at
    return Layout(data, tuple(cursor.decisive), cursor.runs, cursor.texts, tail)


def header_stamp_ns(data: bytes) -> int:
    """Stamp [ns] of a serialized message that begins with a header; 0 if it is too short."""
    if len(data) < ORIGIN + STAMP.size:
        return 0
    stamp = STAMP if data[:2] == LITTLE_ENDIAN else BIG_ENDIAN_STAMP
    seconds, nanoseconds = stamp.unpack_from(data, ORIGIN)
    return seconds * NANOSECONDS + nanoseconds


def header_stamps_ns(messages: NDArray[np.uint8]) -> Integers:
    """Stamps [ns], (n,), of little-endian messages (n, L) that begin with a header."""
    stamps = np.array(messages[:, ORIGIN : ORIGIN + STAMP.size], order="C")
    seconds, nanoseconds = stamps.view("<i4")[:, 0], stamps.view("<u4")[:, 1]
    return seconds.astype(np.int64) * NANOSECONDS + nanoseconds


class _Cursor:
    """Walks through the fields of a message and notes their offsets."""

    def __init__(self, data: bytes):
        if data[: len(LITTLE_ENDIAN)] != LITTLE_ENDIAN:
            raise ValueError(f"encapsulation {data[:2].hex()} instead of {LITTLE_ENDIAN.hex()}")
        self._data = data
        self.at = ORIGIN
        self.decisive = [(0, len(LITTLE_ENDIAN))]
        self.runs: dict[str, NumberRun] = {}
        self.fields: list[str] = []
        self.texts: dict[str, tuple[str, ...]] = {}

    def message(self, type_name: str, place: str) -> None:
        """Walk through a message nested in the field `place`, "" for the outermost message."""
        before = len(self.fields)
        for name, (node, detail) in message_fields()[type_name][1]:
            field = f"{place}.{name}" if place else name
            if node == Nodetype.NAME:
                self.message(detail, field)
            elif node == Nodetype.BASE:
                self._elements(field, detail[0], 1)
            else:
                (element_node, element), size = detail
                count = size if node == Nodetype.ARRAY else self._count()
                if element_node == Nodetype.BASE:
                    self._elements(field, element[0], count)
                else:
                    for k in range(count):
                        self.message(element, f"{field}[{k}]")
        self._join(place, [self.runs[field] for field in self.fields[before:]])

    def _elements(self, field: str, kind: str, count: int) -> None:
        if kind == "string":
            self.texts[field] = tuple(self._text() for _ in range(count))
        elif kind in FORMATS:
            size = struct.calcsize(FORMATS[kind])
            if count:
                self._align(size)
            self.fields.append(field)
            self.runs[field] = NumberRun(self.at, FORMATS[kind], count)
            self._advance(count * size)
        else:
            raise ValueError(f"{field} is a {kind}, which cannot be located")

    def _join(self, place: str, runs: list[NumberRun]) -> None:
        """Note the numbers of a nested message as one run if there are no gaps between them."""
        follows = (a.stop == b.start and a.size == b.size for a, b in pairwise(runs))
        if place and runs and all(follows):
            self.runs[place] = runs[0]._replace(length=sum(run.length for run in runs))

    def _count(self) -> int:
        self._align(COUNT.size)
        start = self.at
        self._advance(COUNT.size)
        self.decisive.append((start, self.at))
        return COUNT.unpack_from(self._data, start)[0]

    def _text(self) -> str:
        length = self._count()
        start = self.at
        self._advance(length)
        self.decisive.append((start, self.at))
        return self._data[start : start + max(length - 1, 0)].decode()

    def _align(self, size: int) -> None:
        self.at += (ORIGIN - self.at) % size

    def _advance(self, size: int) -> None:
        self.at += size
        if self.at > len(self._data):
            raise ValueError(f"a message of {len(self._data)} bytes ends too early")

# SPDX-License-Identifier: Apache-2.0
"""Find where the records of an MCAP chunk begin, by `_records.c` if it was built."""

import struct
from importlib import import_module

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

try:
    _compiled = import_module("intent_recognition.bags.mcap._records").positions
except ImportError:
    _compiled = None

RECORD_HEADER = struct.Struct("<BQ")
MESSAGE_HEADER = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_ns", "<u8"),
        ("publish_ns", "<u8"),
    ]
)
LEAST_MESSAGE = MESSAGE_HEADER.itemsize - RECORD_HEADER.size
MESSAGE = int(Opcode.MESSAGE)
"""Opcode as a plain integer, which numpy compares far faster than an enumeration member."""


def record_positions(data: bytes | memoryview, is_cut: bool) -> NDArray:
    """Offsets of the records of a chunk, int64 (n,), found by following their lengths.

    Args:
        data: the chunk, decompressed.
        is_cut: whether its end may be missing; an incomplete last record is then left out.

    Raises:
        ValueError: a message is too short, or the last record is incomplete.
    """
    found = np.empty(len(data) // RECORD_HEADER.size, np.int64)
    n, end = (_compiled or _positions)(data, found, RECORD_HEADER.size, MESSAGE, LEAST_MESSAGE)
    if end < 0:
        raise ValueError(f"a message of less than {LEAST_MESSAGE} bytes")
    if end != len(data) and not is_cut:
        raise ValueError("the chunk ends inside of a record")
    return found[:n].copy()


def _positions(
    data: bytes | memoryview, out: NDArray, head: int, message: int, least: int
) -> tuple[int, int]:
    """Python version of `_records.c`."""
    n = end = 0
    while 0 <= end <= len(data) - head:
        opcode, length = RECORD_HEADER.unpack_from(data, end)
        if length > len(data) - head - end:
            break
        out[n] = end
        n, end = n + 1, -1 if opcode == message and length < least else end + head + length
    return n, end


def gather(data: bytes | memoryview, positions: NDArray, length: int) -> NDArray:
    """The `length` bytes at each position, as an array of void items (n,)."""
    if not positions.size or not length:
        return np.empty(positions.size, f"V{length}")
    windows = np.ndarray((len(data) - length + 1,), f"V{length}", data, strides=(1,))
    return windows[positions]

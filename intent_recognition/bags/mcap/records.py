# SPDX-License-Identifier: Apache-2.0
"""Where the records of an MCAP chunk begin: thousands of messages found at once."""

import struct

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from intent_recognition.array_types import Integers

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
"""As a plain integer: numpy compares bytes with members of an enumeration far slower."""
LONGEST_PERIOD = 16
"""Messages after which the lengths of a run may repeat. Convention: topics of a robot."""
SHORTEST_RUN = 64
"""Messages in a run; if a run is shorter, the rest of the chunk is searched. Measured: for fewer
the search is faster."""
MOST_OTHERS = 2**17
"""Records of a chunk that are no messages: ids of schemas and channels have 16 bits."""
SEARCH_BYTES = 2**17
"""Bytes searched at once. Convention: they and what is found in them fit the processor's cache."""


def record_positions(data: bytes | memoryview, is_cut: bool) -> NDArray:
    """Where the records of a chunk begin, int64 (n,).

    Each record tells where the next begins. Messages whose lengths repeat are followed by whole
    runs: where each would begin is computed, and that it does begin there is verified in bulk.

    Args:
        data: the chunk, decompressed.
        is_cut: whether its end may be missing; an incomplete last record is then left out.

    Raises:
        ValueError: a record is too short, or the last one incomplete.
    """
    found: list[Integers] = []
    at, size, others = 0, len(data), 0
    search: _Search | None = None
    while at + RECORD_HEADER.size <= size:
        opcode, length = RECORD_HEADER.unpack_from(data, at)
        end = at + RECORD_HEADER.size + length
        if end > size:
            break
        if opcode != MESSAGE:
            others += 1
            if others > MOST_OTHERS:
                raise ValueError(f"more than {MOST_OTHERS} records that are no messages")
            found.append(np.array([at]))
            at = end
            continue
        if length < LEAST_MESSAGE:
            raise ValueError(f"a message of {length} bytes")
        run, end = _periodic_run(data, at) if search is None else search.run(at)
        if run.size < SHORTEST_RUN and search is None:
            search = _Search(data, at)
            run, end = search.run(at)
        found.append(run)
        at = end
    if at != size and not is_cut:
        raise ValueError("the chunk ends inside of a record")
    return np.concatenate(found) if found else np.empty(0, np.int64)


def gather(data: bytes | memoryview, positions: NDArray, length: int) -> NDArray:
    """The `length` bytes from each position on, as one array of void items (n,)."""
    if not positions.size or not length:
        return np.empty(positions.size, f"V{length}")
    windows = np.ndarray((len(data) - length + 1,), f"V{length}", data, strides=(1,))
    return windows[positions]


def _periodic_run(data: bytes | memoryview, start: int) -> tuple[NDArray, int]:
    """Messages from `start` on as long as their lengths repeat; where the last one ends."""
    sizes = _first_sizes(data, start)
    periods = range(1, len(sizes) // 2 + 1)
    period = next((p for p in periods if sizes[p:] == sizes[:-p]), 0)
    if not period:
        return np.empty(0, np.int64), start
    steps = np.array(sizes[:period])
    stride = int(steps.sum())
    rounds = (len(data) - start) // stride
    starts = start + np.concatenate([[0], np.cumsum(steps)[:-1]])
    sound = np.empty((rounds, period), bool)
    for k, (at, step) in enumerate(zip(starts.tolist(), steps.tolist(), strict=True)):
        opcodes = np.ndarray(rounds, np.uint8, data, at, (stride,))
        lengths = np.ndarray(rounds, "<u8", data, at + 1, (stride,))
        sound[:, k] = (opcodes == MESSAGE) & (lengths == step - RECORD_HEADER.size)
    count = sound.size if sound.all() else int(np.argmin(sound))
    positions = (starts + stride * np.arange(rounds)[:, None]).ravel()[:count]
    return positions, int(positions[-1] + steps[(count - 1) % period])


def _first_sizes(data: bytes | memoryview, start: int) -> list[int]:
    """Sizes of the first messages from `start` on, their heads included."""
    sizes: list[int] = []
    at = start
    while len(sizes) < 2 * LONGEST_PERIOD and at + RECORD_HEADER.size <= len(data):
        opcode, length = RECORD_HEADER.unpack_from(data, at)
        end = at + RECORD_HEADER.size + length
        if opcode != MESSAGE or length < LEAST_MESSAGE or end > len(data):
            break
        sizes.append(end - at)
        at = end
    return sizes


class _Search:
    """Finds messages of any lengths: all bytes that look like a head, all at once.

    Where the end of one is the beginning of the next, the chain is followed by whole stretches.
    Nothing is taken for a record that no chain from a true one leads to.
    """

    def __init__(self, data: bytes | memoryview, start: int):
        self._heads, self._ends = _message_heads(data, start)
        self._stops = np.flatnonzero(self._ends[:-1] != self._heads[1:]) + 1

    def run(self, start: int) -> tuple[NDArray, int]:
        """Messages from the one at `start` on, at least this one; where the last one ends."""
        first = int(np.searchsorted(self._heads, start))
        stop = int(np.searchsorted(self._stops, first, side="right"))
        last = int(self._stops[stop]) if stop < self._stops.size else self._heads.size
        return self._heads[first:last], int(self._ends[last - 1])


def _message_heads(data: bytes | memoryview, start: int) -> tuple[NDArray, NDArray]:
    """Offsets from `start` on that may be a whole message record, and where each would end."""
    octets = np.frombuffer(data, np.uint8, len(data) - MESSAGE_HEADER.itemsize + 1)
    stretches = range(start, octets.size, SEARCH_BYTES)
    found = [np.flatnonzero(octets[at : at + SEARCH_BYTES] == MESSAGE) + at for at in stretches]
    heads = np.concatenate(found)
    lengths = gather(data, heads + 1, 8).view("<u8")
    fits = (lengths >= LEAST_MESSAGE) & (lengths <= len(data))
    heads, lengths = heads[fits], lengths[fits].astype(np.int64)
    ends = heads + RECORD_HEADER.size + lengths
    whole = ends <= len(data)
    return heads[whole], ends[whole]

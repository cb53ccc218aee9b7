# SPDX-License-Identifier: Apache-2.0
"""A serialized message whose numbers are written in place."""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags.cdr.layout import NANOSECONDS, ORIGIN, STAMP, find_layout


class SerializedTemplate:
    """The bytes of one message, ready to be published with other numbers.

    Args:
        type_name: message type of Jazzy, "package/msg/Name".
        data: CDR bytes (little endian) of a message with the texts and lengths wanted.

    Attributes:
        doubles: the message as float64, from behind the encapsulation header on; writable.
        integers: the same as int32.

    Raises:
        ValueError: as `find_layout`.
    """

    def __init__(self, type_name: str, data: bytes):
        self._runs = find_layout(type_name, data).runs
        self._data = bytearray(data)
        size = len(data) - ORIGIN
        self.doubles = np.frombuffer(self._data, "<f8", size // 8, ORIGIN)
        self.integers = np.frombuffer(self._data, "<i4", size // 4, ORIGIN)

    def view(self, field: str) -> NDArray:
        """The numbers (count,) of a field, such as "pose.position"; writable."""
        start, dtype, length = self._runs[field]
        return np.frombuffer(self._data, dtype, length, start)

    def indices(self, field: str) -> NDArray[np.intp]:
        """Indices of the numbers (count,) of a field in `doubles` or `integers`."""
        run = self._runs[field]
        return (run.start - ORIGIN) // run.size + np.arange(run.length)

    def stamp(self, time_ns: int) -> None:
        """Write the stamp of the header, with which the message begins."""
        STAMP.pack_into(self._data, ORIGIN, *divmod(int(time_ns), NANOSECONDS))

    def to_bytes(self) -> bytes:
        """The message as it is now."""
        return bytes(self._data)

# SPDX-License-Identifier: Apache-2.0
"""Decode single messages whose layout repeats, several times faster than a general decoder."""

import struct
from collections.abc import Callable
from types import SimpleNamespace

from rosbags.interfaces import Nodetype

from intent_recognition.bags.cdr.layout import (
    LITTLE_ENDIAN,
    MOST_LAYOUTS,
    Layout,
    find_layout,
    message_fields,
)

Decoder = Callable[[bytes], object]
"""Function from CDR bytes to a message with the attributes of its type."""


def layout_decoder(type_name: str, general: Decoder) -> Decoder:
    """A decoder with the same results as `general`, which decodes messages in big endian.

    One `struct` reads all numbers of the messages of one layout.

    Args:
        type_name: message type of Jazzy without sequences of messages.
        general: decoder of the same type.
    """
    known: list[tuple[Layout, Decoder]] = []

    def decode(data: bytes) -> object:
        for layout, found in known:
            if layout.fits(data):
                return found(data)
        if data[:2] != LITTLE_ENDIAN:
            return general(data)
        layout = find_layout(type_name, data)
        found = _decoder_of(type_name, layout)
        if len(known) < MOST_LAYOUTS:
            known.append((layout, found))
        return found(data)

    return decode


def _decoder_of(type_name: str, layout: Layout) -> Decoder:
    """Decoder of the messages of one layout.

    As for a dataclass, the constructor is compiled from the names of the fields: a call for each
    of them would take twice as long.
    """
    numbers, at, count = "<", 0, 0
    indices: dict[str, str] = {}  # of each field among the numbers
    for field in layout.fields:
        run = layout.runs[field]
        numbers += f"{run.start - at}x{run.length}{run.dtype[1:]}"
        indices[field] = f"{count}:{count + run.length}"
        at, count = run.stop, count + run.length

    def constructor(type_name: str, place: str) -> str:
        arguments = []
        for name, (node, detail) in message_fields()[type_name][1]:
            field, single = place + name, node == Nodetype.BASE
            if node == Nodetype.NAME:
                value = constructor(detail, f"{field}.")
            elif field in layout.texts:
                value = f"texts['{field}'][0]" if single else f"[*texts['{field}']]"
            else:
                index = indices[field]
                value = f"numbers[{index.split(':')[0]}]" if single else f"[*numbers[{index}]]"
            arguments.append(f"{name}={value}")
        return f"Message({', '.join(arguments)})"

    code = f"lambda numbers: {constructor(type_name, '')}"
    make = eval(code, {"Message": SimpleNamespace, "texts": layout.texts})
    unpack = struct.Struct(numbers).unpack_from
    return lambda data: make(unpack(data))

# SPDX-License-Identifier: Apache-2.0
"""Decode single messages whose layout repeats, several times faster than a general decoder."""

import struct
from collections.abc import Callable, Sequence
from operator import itemgetter
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


Maker = Callable[[tuple], object]
"""Function from all numbers of a message to a part of it."""


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
    """Decoder of the messages of one layout."""
    numbers, at, count = "<", 0, 0
    places: dict[str, slice] = {}  # of each field among the numbers
    for field in layout.fields:
        run = layout.runs[field]
        numbers += f"{run.start - at}x{run.length}{run.dtype[1:]}"
        places[field] = slice(count, count + run.length)
        at, count = run.stop, count + run.length

    def maker(type_name: str, place: str) -> Maker:
        names, parts = [], []
        for name, (node, detail) in message_fields()[type_name][1]:
            field, single = place + name, node == Nodetype.BASE
            names.append(name)
            if node == Nodetype.NAME:
                parts.append(maker(detail, f"{field}."))
            elif field in layout.texts:
                parts.append(_text(layout.texts[field], single))
            else:
                there = places[field]
                parts.append(itemgetter(there.start) if single else _list_of(there))
        return lambda numbers: SimpleNamespace(
            **dict(zip(names, [part(numbers) for part in parts], strict=True))
        )

    unpack, make = struct.Struct(numbers).unpack_from, maker(type_name, "")
    return lambda data: make(unpack(data))


def _text(texts: Sequence[str], single: bool) -> Maker:
    return (lambda _: texts[0]) if single else (lambda _: [*texts])


def _list_of(there: slice) -> Maker:
    return lambda numbers: [*numbers[there]]

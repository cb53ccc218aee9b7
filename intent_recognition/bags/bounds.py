# SPDX-License-Identifier: Apache-2.0
"""Bounds on message definitions, so that parsing them and decoding their messages end."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from rosbags.interfaces import Nodetype
from rosbags.typesys import get_types_from_msg

LONGEST_DEFINITION = 100_000
"""Longest accepted definition, including all types it contains [bytes]; parsing it takes 3 s.
Jazzy's longest has 4000, or 20 000 with comments."""

UNPARSED = re.compile(r"(?m)\bw(?=string<=)|^[ \t]*string[ \t]+\w+[ \t]*=[ \t]*$")
"""Text that the parser rejects: the `w` of a bounded `wstring`, and empty string constants."""


class _Size(NamedTuple):
    """The fewest values and bytes that a message of a type can have."""

    values: int
    bytes: int


def check_definition(name: str, text: str) -> None:
    """Make sure that a definition can be parsed, and its messages decoded, in bounded time.

    `text` defines the type `name` and all types it contains, in the ros2msg format.

    Raises:
        ValueError: the definition is too long or nested too deeply, or allows endless messages.
    """
    if len(text) > LONGEST_DEFINITION:
        raise ValueError(f"a definition of {len(text)} bytes, more than {LONGEST_DEFINITION}")
    types = get_types_from_msg(UNPARSED.sub("", text), name)
    if (count := sum(len(fields) for _, fields in types.values())) > 2000:
        raise ValueError(f"a definition of {count} fields, more than 2000")
    _size(next(iter(types)), types, {}, 0)


def _size(name: str, types: Mapping[str, Any], known: dict[str, _Size], depth: int) -> _Size:
    if depth > 16:  # Jazzy's deepest types are nested 6 levels deep
        raise ValueError("more than 16 types within one another")
    if name not in types:  # undefined: the parser raises later
        return _Size(1, 1)
    if name not in known:
        values = size = 0
        for _, (node, detail) in types[name][1]:
            times, is_sequence = 1, node == Nodetype.SEQUENCE
            if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                (node, detail), times = detail
            inner = _Size(1, 1)
            if node == Nodetype.NAME:
                inner = _size(detail, types, known, depth + 1)
            if is_sequence and not inner.bytes:
                raise ValueError(f"a sequence of {detail}, which has no bytes")
            values += 1 if is_sequence else times * inner.values
            size += 1 if is_sequence else times * inner.bytes
            if values > 1_000_000:  # a covariance has 36
                raise ValueError("messages of more than 1000000 values")
        known[name] = _Size(max(values, 1), size)
    return known[name]

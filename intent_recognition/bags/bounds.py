# SPDX-License-Identifier: Apache-2.0
"""What a message definition in a bag may ask for: neither its parser nor its messages may be
endless.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

LONGEST_DEFINITION = 100_000
"""Bytes of a definition with those of all types it contains. Convention: Jazzy's longest have 4000,
with their comments 20 000."""
_SEPARATOR = re.compile(r"^=+\s*$", re.MULTILINE)
_FIELD = re.compile(r"^(?P<type>[\w/]+)(<=\d+)?(?P<array>\[(?P<bound><=)?(?P<size>\d*)\])?\s+\w")


class _Field(NamedTuple):
    """A field: its type, how often it stands there, and whether the message says how often."""

    type: str
    times: int
    is_sequence: bool


class _Size(NamedTuple):
    """What a message of a type has at least: values, and bytes."""

    values: int
    bytes: int


def check_definition(name: str, text: str) -> None:
    """Make sure that a definition can be parsed, and its messages decoded, in bounded time.

    The text holds that of the type `name` and of all types it contains, in the form ros2msg.

    Raises:
        ValueError: it is too long, too deep, or a message of it could be endless.
    """
    if len(text) > LONGEST_DEFINITION:
        raise ValueError(f"a definition of {len(text)} bytes, more than {LONGEST_DEFINITION}")
    first, *others = _SEPARATOR.split(text)
    types = {name: _fields(first)}
    for other in others:
        head, _, body = other.strip().partition("\n")
        types[head.removeprefix("MSG:").strip()] = _fields(body)
    if (count := sum(map(len, types.values()))) > 2000:
        raise ValueError(f"a definition of {count} fields, more than 2000")
    _size(name, types, {}, 0)


def _fields(text: str) -> list[_Field]:
    found = []
    for line in text.splitlines():
        content = line.partition("#")[0].strip()
        match = _FIELD.match(content)
        if match and "=" not in content.removeprefix(match[0]).split("#")[0].replace("<=", ""):
            fixed = match["array"] is not None and not match["bound"] and match["size"]
            if fixed and len(match["size"]) > 9:
                raise ValueError(f"an array of {match['size'][:20]} values")
            is_sequence = match["array"] is not None and not fixed
            found.append(_Field(match["type"], int(match["size"]) if fixed else 1, is_sequence))
    return found


def _size(
    name: str, types: Mapping[str, list[_Field]], known: dict[str, _Size], depth: int
) -> _Size:
    if depth > 16:  # Jazzy's deepest have 6
        raise ValueError("more than 16 types within one another")
    fields = types.get(name)
    if fields is None:  # a number, a text or a type that is not defined; its parser says so
        return _Size(1, 1)
    if name not in known:
        values = size = 0
        for field in fields:
            inner = _size(_find(field.type, types), types, known, depth + 1)
            if field.is_sequence and not inner.bytes:
                raise ValueError(f"a sequence of {field.type}, which has no bytes")
            values += 1 if field.is_sequence else field.times * inner.values
            size += 1 if field.is_sequence else field.times * inner.bytes
            if values > 1_000_000:  # a covariance has 36
                raise ValueError("messages of more than 1000000 values")
        known[name] = _Size(max(values, 1), size)
    return known[name]


def _find(name: str, types: Mapping[str, list[_Field]]) -> str:
    """A type as the definition names it: with its package, or without."""
    if name in types:
        return name
    short = name.replace("/msg/", "/")
    ends = f"/{short.rsplit('/', 1)[-1]}"
    return next((n for n in types if n.replace("/msg/", "/") == short or n.endswith(ends)), name)

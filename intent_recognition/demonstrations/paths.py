# SPDX-License-Identifier: Apache-2.0
"""Paths of numbers in messages: attributes, and elements of arrays by number or by name."""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from intent_recognition.bags import NANOSECONDS

FIELD_PATH = re.compile(r"[A-Za-z_]\w*(\.\w+|\[[^\[\]]+\])*")
"""Such as pose.position.x, poses[7].position.x, data.0, transforms[wrist].transform.rotation.w."""
MOST_ELEMENTS = 10_000
"""Element of an array from which on none is read or written. Convention."""
PART = re.compile(r"\.?(?P<attribute>[A-Za-z_]\w*)|\.(?P<number>\d+)|\[(?P<element>[^\[\]]+)\]")
NUMBER = re.compile(r"\.(\d+)(?=[.\[]|$)|\[(\d+)\]")
STAMPED_ELEMENTS = ("tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray")
"""Types without a stamp of their own, but one in each element of their array."""


class ElementAbsentError(LookupError):
    """An array does not have the element that a path names."""


class ElementName(NamedTuple):
    """The element of an array that has this name: a frame, or namespace/id of a marker."""

    name: str


Part = str | int | ElementName


@lru_cache(maxsize=4096)
def parse_path(field: str) -> tuple[Part, ...]:
    """The steps of a path that `FIELD_PATH` matches, in order."""
    parts: list[Part] = []
    for match in PART.finditer(field):
        attribute, number, element = match.group("attribute", "number", "element")
        if attribute is not None:
            parts.append(attribute)
        elif number is not None or element.isdecimal():
            parts.append(int(number or element))
        else:
            parts.append(ElementName(element.lstrip("/")))
    return tuple(parts)


def is_path(field: str) -> bool:
    """Whether a text is a path, to elements that an array may have."""
    if not FIELD_PATH.fullmatch(field):
        return False
    indices = (max(found) for found in NUMBER.findall(field))
    return all(len(index) < 9 and int(index) < MOST_ELEMENTS for index in indices)


@lru_cache(maxsize=4096)
def element_of(field: str) -> tuple[Part, ...]:
    """The steps to the first element of an array in a path; empty where there is none."""
    parts = parse_path(field)
    at = next((k for k, part in enumerate(parts) if not isinstance(part, str)), None)
    return () if at is None else parts[: at + 1]


def follow(message: Any, parts: Sequence[Part]) -> Any:
    """What a path leads to.

    Raises:
        ElementAbsentError: an array has no such element.
        AttributeError, TypeError: a message has no such attribute, or it is no array.
    """
    value = message
    for part in parts:
        if isinstance(part, str):
            value = getattr(value, part)
        elif isinstance(part, int):
            if part >= len(value):
                raise ElementAbsentError(f"element {part} of {len(value)}")
            value = value[part]
        else:
            value = _named(value, part.name)
    return value


def element_stamps_ns(message: Any, fields: Sequence[str]) -> list[int]:
    """Stamps of the elements that some fields are of, as far as a message has them."""
    stamps = []
    for parts in dict.fromkeys(map(element_of, fields)):
        try:
            stamp = follow(message, parts).header.stamp
        except (ElementAbsentError, AttributeError, TypeError):
            continue
        stamps.append(stamp.sec * NANOSECONDS + stamp.nanosec)
    return stamps


def element_names(message: Any, fields: Sequence[str]) -> Iterator[str]:
    """Names of all elements in the arrays that some fields are of."""
    for parts in dict.fromkeys(map(element_of, fields)):
        yield from map(_name, follow(message, parts[:-1]))


def _named(elements: Sequence[Any], name: str) -> Any:
    for element in elements:
        if _name(element) == name:
            return element
    raise ElementAbsentError(f"element {name}")


def _name(element: Any) -> str:
    """Child frame of a transform, namespace/id of a marker."""
    frame: str | None = getattr(element, "child_frame_id", None)
    return f"{element.ns}/{element.id}" if frame is None else frame.lstrip("/")

# SPDX-License-Identifier: Apache-2.0
"""Paths of numbers in messages: attributes, and elements of arrays by number or by name."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

FIELD_PATH = re.compile(r"[A-Za-z_]\w*(\.\w+|\[[^\[\]]+\])*")
"""Such as pose.position.x, poses[7].position.x, data.0, transforms[wrist].transform.rotation.w,
rigidbodies[rigid_body_name=wrist].pose.position.x."""
MOST_ELEMENTS = 10_000
"""Element of an array from which on none is read or written. Convention: landmarks of a face and
two hands are some 500."""
PART = re.compile(r"\.?(?P<attribute>[A-Za-z_]\w*)|\.(?P<number>\d+)|\[(?P<element>[^\[\]]+)\]")
NUMBER = re.compile(r"\.(\d+)(?=[.\[]|$)|\[(\d+)\]")
STAMPED_ELEMENTS = ("tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray")
"""Types without a stamp of their own, but one in each element of their array."""


class ElementAbsentError(LookupError):
    """An array does not have the element that a path names."""


class ElementName(NamedTuple):
    """The element of an array that has this name.

    Attributes:
        name: a frame, a name, or namespace/id of a marker; a number as text.
        key: attribute of the element that is the name, such as `rigid_body_name` or
            `header.frame_id`; empty for the usual one of its type.
    """

    name: str
    key: str = ""


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
            key, _, name = element.rpartition("=")
            parts.append(ElementName(name.strip().lstrip("/"), key.strip()))
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
            if part >= len(value) or is_deleted(value[part]):
                raise ElementAbsentError(f"element {part} of {len(value)}")
            value = value[part]
        else:
            value = _named(value, part)
    return value


def element_headers(message: Any, fields: Sequence[str]) -> list[Any]:
    """Headers of the elements that some fields are of, as far as a message has them."""
    headers = []
    for parts in dict.fromkeys(map(element_of, fields)):
        with suppress(ElementAbsentError, AttributeError, TypeError):
            headers.append(follow(message, parts).header)
    return headers


def element_names(message: Any, fields: Sequence[str]) -> Iterator[str]:
    """Names of all elements in the arrays that some fields are of."""
    for parts in dict.fromkeys(map(element_of, fields)):
        last = parts[-1]
        key = last.key if isinstance(last, ElementName) else ""
        yield from (_name(element, key) for element in follow(message, parts[:-1]))


def _named(elements: Sequence[Any], wanted: ElementName) -> Any:
    for element in elements:
        if _name(element, wanted.key) == wanted.name:
            return element
    raise ElementAbsentError(f"element {wanted.name}")


def _name(element: Any, key: str) -> str:
    """What a key of an element says; else child frame of a transform, name, namespace/id."""
    if key:
        return str(attrgetter(key)(element)).lstrip("/")
    for usual in ("child_frame_id", "name"):
        if (name := getattr(element, usual, None)) is not None:
            return str(name).lstrip("/")
    return "" if is_deleted(element) else f"{element.ns}/{element.id}"


def is_deleted(element: Any) -> bool:
    """Whether it is a marker that says what to take away, and nothing of a place."""
    return getattr(element, "action", 0) in (2, 3) and hasattr(element, "ns")

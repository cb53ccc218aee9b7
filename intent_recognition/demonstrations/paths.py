# SPDX-License-Identifier: Apache-2.0
"""Paths to numbers in messages, through attributes and array elements by index or name."""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

FIELD_PATH = re.compile(r"[A-Za-z_]\w*(\.\w+|\[[^\[\]]+\])*")
"""Pattern of a path, such as pose.position.x, poses[7].position.x, data.0,
transforms[wrist].transform.rotation.w, rigidbodies[rigid_body_name=wrist].pose.position.x."""
MOST_ELEMENTS = 10_000
"""Upper bound of array indices in paths; landmarks of a face and two hands number about 500."""
PART = re.compile(r"\.?(?P<attribute>[A-Za-z_]\w*)|\.(?P<number>\d+)|\[(?P<element>[^\[\]]+)\]")
NUMBER = re.compile(r"\.(\d+)(?=[.\[]|$)|\[(\d+)\]")
STAMPED_ELEMENTS = ("tf2_msgs/msg/TFMessage", "visualization_msgs/msg/MarkerArray")
"""Message types whose array elements have stamps, while the message itself has none."""


class ElementAbsentError(LookupError):
    """An array does not have the element that a path names."""


class ElementName(NamedTuple):
    """Selects the array element with a given name."""

    name: str  # a frame, a name, or namespace/id of a marker; numbers as text
    # attribute that holds the element's name, such as `rigid_body_name` or `header.frame_id`; empty
    # for the usual attribute of its type
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
    """Whether a text is a path whose array indices are below `MOST_ELEMENTS`."""
    if not FIELD_PATH.fullmatch(field):
        return False
    indices = (max(found) for found in NUMBER.findall(field))
    return all(len(index) < 9 and int(index) < MOST_ELEMENTS for index in indices)


@lru_cache(maxsize=4096)
def element_of(field: str) -> tuple[Part, ...]:
    """The steps of a path up to its first array element; empty if it has none."""
    parts = parse_path(field)
    at = next((k for k, part in enumerate(parts) if not isinstance(part, str)), None)
    return () if at is None else parts[: at + 1]


def follow(message: Any, parts: Sequence[Part]) -> Any:
    """The value at a path in a message.

    Raises:
        ElementAbsentError: an array has no such element.
        AttributeError, TypeError: an attribute is missing or is not an array.
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
    """Headers of the array elements of some fields, as far as the message has them."""
    headers = []
    for parts in dict.fromkeys(map(element_of, fields)):
        with suppress(ElementAbsentError, AttributeError, TypeError):
            headers.append(follow(message, parts).header)
    return headers


def element_names(message: Any, fields: Sequence[str]) -> Iterator[str]:
    """Names of all elements of the arrays that contain some fields."""
    for parts in filter(None, dict.fromkeys(map(element_of, fields))):
        last = parts[-1]
        key = last.key if isinstance(last, ElementName) else ""
        yield from (_name(element, key) for element in follow(message, parts[:-1]))


def _named(elements: Sequence[Any], wanted: ElementName) -> Any:
    for element in elements:
        if _name(element, wanted.key) == wanted.name:
            return element
    raise ElementAbsentError(f"element {wanted.name}")


def _name(element: Any, key: str) -> str:
    """Name of an element: the value of `key`, or else its child frame, name or namespace/id."""
    if is_deleted(element):
        return ""
    if key:
        return str(attrgetter(key)(element)).lstrip("/")
    for usual in ("child_frame_id", "name"):
        if (name := getattr(element, usual, None)) is not None:
            return str(name).lstrip("/")
    return f"{element.ns}/{element.id}"


def body_of(message: Any) -> str:
    """Name of the body that a message is of; "" if it has none, or a list of names."""
    if not isinstance(getattr(message, "name", ""), str):
        return ""
    try:
        return _name(message, "")
    except AttributeError:
        return ""


def is_deleted(element: Any) -> bool:
    """Whether an element is a marker that deletes markers, or says that it was not seen."""
    occluded, valid = getattr(element, "occluded", False), getattr(element, "valid", True)
    if (isinstance(occluded, int) and occluded) or (isinstance(valid, int) and not valid):
        return True  # flags, not one for each of several parts
    return getattr(element, "action", 0) in (2, 3) and hasattr(element, "ns")

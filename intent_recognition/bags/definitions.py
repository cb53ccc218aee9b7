# SPDX-License-Identifier: Apache-2.0
"""Message definitions, type hashes and serialisation without ROS, from the Jazzy type store."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from intent_recognition.errors import MessageError, describe

SEPARATOR = "=" * 80 + "\n"
TIME_TYPES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
BASE, NAME, ARRAY = 1, 2, 3  # rosbags' node types of a field description
NUMPY_TYPES = {"bool": "bool", "byte": "uint8", "octet": "uint8", "char": "uint8"}


@dataclass(frozen=True)
class Definition:
    """What a bag says about a type: its text with all nested types, and its RIHS01 hash."""

    type: str
    text: str
    type_hash: str
    encoding: str = "ros2msg"


@lru_cache(maxsize=1)
def jazzy_types():
    """The shared Jazzy type store; types of installed packages are added as they are asked for."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=1)
def jazzy_names() -> frozenset[str]:
    """Names of the types that come with the type store."""
    return frozenset(get_typestore(Stores.ROS2_JAZZY).fielddefs)


@cache
def definition(type_name: str) -> Definition:
    """Definition of a message type: Jazzy's own, else that of the installed package.

    Raises:
        MessageError: the type is neither in the type store nor installed.
    """
    store = jazzy_types()
    if type_name in jazzy_names():
        text, _ = store.generate_msgdef(type_name, ros_version=2)
        return Definition(type_name, text, store.hash_rihs01(type_name))
    texts: dict[str, str] = {}
    _collect_installed(type_name, texts)
    head, *nested = texts
    text = texts[head] + "".join(f"{SEPARATOR}MSG: {_short(n)}\n{texts[n]}" for n in nested)
    return Definition(type_name, text, _installed_hash(type_name))


def message_class(type_name: str) -> type:
    """The data class of a message type, as rosbags' type store builds it.

    Raises:
        MessageError: the type is unknown.
    """
    _ensure_registered(type_name)
    return jazzy_types().types[type_name]


def make_message(type_name: str, fields: Mapping[str, object]) -> object:
    """Build a message from nested mappings; fields left out are zero or empty.

    A time may be given as integer nanoseconds: {"header": {"stamp": 1_000_000_000}}.

    Raises:
        MessageError: an unknown type, an unknown field, or a value that does not fit its field.
    """
    _ensure_registered(type_name)
    return _build(type_name, fields, type_name)


def serialize(type_name: str, message: object) -> bytes:
    """CDR bytes (little endian) of a mapping or of a message of the type store.

    Raises:
        MessageError: the message does not fit the type.
    """
    if isinstance(message, Mapping):
        message = make_message(type_name, message)
    _ensure_registered(type_name)
    try:
        return bytes(jazzy_types().serialize_cdr(message, type_name))
    except Exception as error:  # rosbags' generated code raises what struct and numpy raise
        raise MessageError(
            describe("message", f"a {type_name}", error, "Give every field its declared type.")
        ) from error


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a stamp, as builtin_interfaces/Time holds them."""
    return divmod(int(stamp_ns), 1_000_000_000)


def _build(type_name: str, fields: object, place: str) -> object:
    store = jazzy_types()
    kind = store.types[type_name]
    if isinstance(fields, kind):
        return fields
    if type_name in TIME_TYPES and isinstance(fields, int | np.integer):
        seconds, nanoseconds = split_stamp(fields)
        return kind(sec=seconds, nanosec=nanoseconds)
    declared = store.fielddefs[type_name][1]
    if not isinstance(fields, Mapping):
        raise MessageError(
            describe(place, f"a mapping for {type_name}", fields, "Name the fields.")
        )
    if unknown := sorted(set(fields) - {name for name, _ in declared}):
        has = ", ".join(name for name, _ in declared)
        raise MessageError(
            describe(place, f"fields among {has}", ", ".join(unknown), "Correct the name.")
        )
    return kind(
        **{name: _value(kind, fields.get(name), f"{place}.{name}") for name, kind in declared}
    )


def _value(kind: tuple, value: object, place: str) -> object:
    """One field's value from `value`, or its zero when that is None."""
    node, detail = int(kind[0]), kind[1]
    try:
        if node == NAME:
            return _build(detail, {} if value is None else value, place)
        if node == BASE:
            return _base(detail[0], value)
        (item_node, item), size = detail
        if value is None:
            value = [None] * (size if node == ARRAY else 0)
        if int(item_node) == NAME:
            return [
                _build(item, {} if v is None else v, f"{place}[{i}]") for i, v in enumerate(value)
            ]
        if item[0] == "string":
            return [_base("string", v) for v in value]
        zeros = [0 if v is None else v for v in value]
        array = np.array(zeros, dtype=NUMPY_TYPES.get(item[0], item[0]))
        if array.ndim != 1 or (node == ARRAY and array.size != size):
            raise ValueError(f"{array.shape} values instead of {size}")
        return array
    except (TypeError, ValueError, OverflowError) as error:
        raise MessageError(
            describe(place, "a value of the declared type", error, "Correct the value.")
        ) from error


def _base(kind: str, value: object) -> object:
    if kind in ("string", "wstring"):
        if value is not None and not isinstance(value, str):
            raise TypeError(f"{value!r} is no text")
        return value or ""
    if kind == "bool":
        return bool(value)
    if kind.startswith("float"):
        return 0.0 if value is None else float(value)
    return 0 if value is None else int(value)


def _ensure_registered(type_name: str) -> None:
    store = jazzy_types()
    if type_name in store.fielddefs:
        return
    texts: dict[str, str] = {}
    _collect_installed(type_name, texts)
    types = {}
    for name, text in texts.items():
        types.update(get_types_from_msg(text, name))
    store.register({n: t for n, t in types.items() if n not in store.fielddefs})


def _collect_installed(type_name: str, texts: dict[str, str]) -> None:
    """Add the definition text of `type_name` and of all it contains, outermost first."""
    if type_name in texts:
        return
    texts[type_name] = _share_file(type_name, ".msg").read_text(encoding="utf-8").rstrip() + "\n"
    for described in get_types_from_msg(texts[type_name], type_name).values():
        for _, kind in described[1]:
            inner = kind if int(kind[0]) in (BASE, NAME) else kind[1][0]
            if int(inner[0]) == NAME:
                _collect_installed(inner[1], texts)


def _installed_hash(type_name: str) -> str:
    """RIHS01 hash the installed package states for its type, "" when it states none."""
    try:
        stated = json.loads(_share_file(type_name, ".json").read_text(encoding="utf-8"))
    except (MessageError, OSError, ValueError):
        return ""
    hashes = {item["type_name"]: item["hash_string"] for item in stated.get("type_hashes", [])}
    return hashes.get(type_name, "")


def _share_file(type_name: str, suffix: str) -> Path:
    package, kind, name = (*type_name.split("/"), "", "")[:3]
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        path = Path(prefix, "share", package, kind, name + suffix)
        if kind and path.is_file():
            return path
    raise MessageError(
        describe(
            "type",
            "a message type of Jazzy or of an installed package",
            type_name,
            "Install the package, or source its workspace.",
        )
    )


def _short(type_name: str) -> str:
    return type_name.replace("/msg/", "/")

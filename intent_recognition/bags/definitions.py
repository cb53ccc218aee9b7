# SPDX-License-Identifier: Apache-2.0
"""Message definitions, type hashes and serialization from the Jazzy type store, without ROS."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from intent_recognition.bags.cdr.layout import NANOSECONDS
from intent_recognition.errors import MessageError

SEPARATOR = "=" * 80 + "\n"
"""Separates the definitions of a type and of the types it contains, in the ros2msg format."""
TIME_TYPES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
NUMPY_TYPES = {"bool": "bool", "byte": "uint8", "octet": "uint8", "char": "uint8"}
"""Numpy's names of the number types for which they differ."""


@dataclass(frozen=True)
class Definition:
    """Definition of a message type as a bag stores it."""

    type: str  # "package/msg/Name"
    text: str  # definitions of the type and of all types it contains
    type_hash: str  # RIHS01 hash, "" when unknown
    encoding: str = "ros2msg"  # MCAP's name for the format of `text`, "" without text
    messages: str = "cdr"  # MCAP's name for the encoding of the messages


@lru_cache(maxsize=1)
def jazzy_types() -> Typestore:
    """The shared Jazzy type store, to which types of installed packages are added on demand."""
    return get_typestore(Stores.ROS2_JAZZY)


@lru_cache(maxsize=1)
def jazzy_names() -> frozenset[str]:
    """Names of the types that come with the type store."""
    return frozenset(get_typestore(Stores.ROS2_JAZZY).fielddefs)


@cache
def definition(type_name: str) -> Definition:
    """Definition of a message type, from Jazzy or else from the installed package."""
    store = jazzy_types()
    if type_name in jazzy_names():
        text, _ = store.generate_msgdef(type_name, ros_version=2)
        return Definition(type_name, text, store.hash_rihs01(type_name))
    texts: dict[str, str] = {}
    _collect_installed(type_name, texts)
    head, *nested = texts
    text = texts[head] + "".join(
        f"{SEPARATOR}MSG: {n.replace('/msg/', '/')}\n{texts[n]}" for n in nested
    )
    return Definition(type_name, text, _installed_hash(type_name))


def message_class(type_name: str) -> type:
    """The data class that rosbags' type store builds for a message type.

    Raises:
        MessageError: the type is unknown.
    """
    _ensure_registered(type_name)
    return jazzy_types().types[type_name]


def make_message(type_name: str, fields: Mapping[str, object]) -> object:
    """Build a message from nested mappings; fields left out are zero or empty.

    A time may be given as integer nanoseconds: {"header": {"stamp": 1_000_000_000}}.
    """
    _ensure_registered(type_name)
    return _build(type_name, fields, type_name)


def serialize(type_name: str, message: object) -> bytes:
    """Serialize a mapping, or a message of the type store, as little-endian CDR."""
    if isinstance(message, Mapping):
        message = make_message(type_name, message)
    _ensure_registered(type_name)
    try:
        return bytes(jazzy_types().serialize_cdr(message, type_name))
    except Exception as error:  # rosbags' generated code may raise any error of struct and numpy
        cure = "Give every field its declared type."
        raise MessageError.about("message", f"a {type_name}", error, cure) from error


def _build(type_name: str, fields: Any, place: str) -> object:
    store = jazzy_types()
    kind = store.types[type_name]
    if isinstance(fields, kind):
        return fields
    if type_name in TIME_TYPES and isinstance(fields, int | np.integer):
        seconds, nanoseconds = divmod(int(fields), NANOSECONDS)
        return kind(sec=seconds, nanosec=nanoseconds)
    declared: Any = store.fielddefs[type_name][1]
    if not isinstance(fields, Mapping):
        raise MessageError.about(place, f"a mapping for {type_name}", fields, "Name the fields.")
    if unknown := sorted(set(fields) - {name for name, _ in declared}):
        has = ", ".join(name for name, _ in declared)
        cure = "Correct the name."
        raise MessageError.about(place, f"fields among {has}", ", ".join(unknown), cure)
    values: dict[str, Any] = {
        name: _value(field, fields.get(name), f"{place}.{name}") for name, field in declared
    }
    return kind(**values)


def _value(kind: tuple, value: Any, place: str) -> object:
    """Convert `value` to a field's type; None gives zero or an empty value."""
    node, detail = kind
    try:
        if node == Nodetype.NAME:
            return _build(detail, {} if value is None else value, place)
        if node == Nodetype.BASE:
            return _base(detail[0], value)
        (item_node, item), size = detail
        if value is None:
            value = [None] * (size if node == Nodetype.ARRAY else 0)
        if item_node == Nodetype.NAME:
            return [
                _build(item, {} if v is None else v, f"{place}[{i}]") for i, v in enumerate(value)
            ]
        if item[0] == "string":
            return [_base("string", v) for v in value]
        zeros = [0 if v is None else v for v in value]
        array = np.array(zeros, dtype=NUMPY_TYPES.get(item[0], item[0]))
        if array.ndim != 1 or (node == Nodetype.ARRAY and array.size != size):
            raise ValueError(f"{array.shape} values instead of {size}")
        return array
    except (TypeError, ValueError, OverflowError) as error:
        cure = "Correct the value."
        raise MessageError.about(place, "a value of the declared type", error, cure) from error


def _base(kind: str, value: Any) -> object:
    if kind in ("string", "wstring"):
        if value is not None and not isinstance(value, str):
            raise TypeError(f"{value!r} is not a text")
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
    """Add the definitions of `type_name` and of all types it contains, outermost first."""
    if type_name in texts:
        return
    texts[type_name] = _share_file(type_name, ".msg").read_text(encoding="utf-8").rstrip() + "\n"
    for described in get_types_from_msg(texts[type_name], type_name).values():
        field: Any
        for _, field in described[1]:
            node, detail = field
            if node in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                (node, detail), _ = detail
            if node == Nodetype.NAME:
                _collect_installed(detail, texts)


def _installed_hash(type_name: str) -> str:
    """RIHS01 hash that the installed package states for the type, "" if it states none."""
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
    expected = "a message type of Jazzy or of an installed package"
    cure = "Install the package, or source its workspace."
    raise MessageError.about("type", expected, type_name, cure)

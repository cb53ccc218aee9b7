# SPDX-License-Identifier: Apache-2.0
"""Raw and decoded messages of a bag, and the decoders of their types."""

import re
from collections.abc import Callable
from contextlib import redirect_stderr, suppress
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from io import StringIO
from typing import Any

import zstandard
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from intent_recognition.bags.bounds import LONGEST_DEFINITION, check_definition
from intent_recognition.bags.cdr.layout import NANOSECONDS
from intent_recognition.bags.definitions import definition, jazzy_names, jazzy_types
from intent_recognition.errors import MessageError

Decoder = Callable[[bytes], object]
"""Function from CDR bytes to a message with the attributes of its type."""
ZSTD = b"\x28\xb5\x2f\xfd"
"""First bytes of a file or message compressed by zstd; no CDR message begins with them."""
ROS_ENCODINGS = ("cdr", "ros1", "")
"""Message encodings that can be decoded; others (JSON, protobuf) are copied unchanged."""
HEADER = "std_msgs/msg/Header"
RECOVER = "Save what is left with `intent recover`."
"""Advice in messages about damaged recordings."""


@dataclass(frozen=True)
class RawMessage:
    """One message as it was recorded."""

    topic: str  # name as recorded
    type: str  # "package/msg/Name"
    log_time_ns: int
    publish_time_ns: int
    data: bytes  # CDR bytes with their encapsulation header
    sequence: int = 0  # sequence number of the publisher, 0 when unknown


@dataclass(frozen=True)
class BagMessage:
    """One decoded message."""

    topic: str  # name as recorded
    type: str  # "package/msg/Name"
    log_time_ns: int
    stamp_ns: int  # header stamp, or the log time for a type without header
    message: Any  # an object with the attributes of the type


def complete_schema(said: Schema | None, type_name: str) -> Schema | None:
    """The definition of a channel's type in the ros2msg format, whatever format the file uses.

    A definition in ROS 1 or IDL format is translated. Where the file has no usable definition,
    Jazzy's for the type's name (or `type_name`) is taken, and else `said` is returned.
    """
    if said is not None and said.encoding == "ros2msg" and said.data:
        package, _, kind = said.name.rpartition("/")
        name = f"{package}/msg/{kind}" if package and "/" not in package else said.name
        return replace(said, data=_as_rosbag2(said.data), name=name)
    name = said.name if said is not None else type_name
    if said is not None and said.encoding == "ros1msg":
        name = normalize_msgtype(name)
    text = None
    if said is not None and said.data:
        with suppress(Exception):  # the definition parser may raise anything
            text = _typestore(said.encoding, bytes(said.data), name).generate_msgdef(
                name, ros_version=2
            )[0]
    if text is None and name in jazzy_names():
        text = definition(name).text
    if text is None:  # not "", the definition of std_msgs/msg/Empty
        return said
    return Schema(data=text.encode(), encoding="ros2msg", id=said.id if said else 0, name=name)


def _as_rosbag2(text: bytes) -> bytes:
    """A ros2msg definition as rosbag2 writes it, the only spelling that all parsers accept."""
    unix = text.replace(b"\r\n", b"\n")
    split = re.sub(rb"(?m)^==+[ \t]*$", b"=" * 80, unix)
    return re.sub(rb"(?m)^([ \t]*(?:MSG:[ \t]*)?\w+)/msg/", rb"\1/", split)


@lru_cache(maxsize=256)
def _typestore(encoding: str, data: bytes, name: str) -> Typestore:
    """Types of a definition in the ros1msg or ros2idl format."""
    text = data.decode().replace("\r\n", "\n")
    store = get_typestore(Stores.EMPTY)
    if encoding == "ros1msg":
        check_definition(name, text)
        header = {HEADER: jazzy_types().fielddefs[HEADER]}  # without the `seq` of ROS 1
        types = get_types_from_msg(text, name)
        for kind, (constants, fields) in types.items():  # ROS 2 field names are lower case
            small = [(field.lower(), content) for field, content in fields]
            types[kind] = (constants, small if len(dict(small)) == len(fields) else fields)
        store.register({**types, **header})
    elif encoding == "ros2idl" and len(text) <= LONGEST_DEFINITION:
        parts = re.split(r"^=+\nIDL: .*\n", text, flags=re.MULTILINE)
        for part in filter(str.strip, parts):
            store.register(get_types_from_idl(part))
    return store


def converter(encoding: str, schema: Schema | None) -> Callable[[bytes], bytes]:
    """Function from the recorded bytes of a message to CDR bytes."""
    if encoding != "ros1" or schema is None:
        return unpacked
    name, text = normalize_msgtype(schema.name), bytes(schema.data)
    return lambda data: bytes(_typestore("ros1msg", text, name).ros1_to_cdr(data, name))


def unpacked(data: bytes) -> bytes:
    """Decompress a message if rosbag2 compressed it; any other message is returned unchanged."""
    try:
        size = zstandard.frame_content_size(data) if data[:4] == ZSTD else None
    except zstandard.ZstdError:
        size = None
    if size is None:
        return data
    if not 0 <= size <= 2**26:
        raise ValueError(f"a message of {size} bytes unpacked, more than {2**26}")
    return zstandard.ZstdDecompressor().decompress(data)


def schema_decoder(schema: Schema) -> Decoder | None:
    """Function from CDR bytes to a message with the attributes of its type.

    None when the format of the definition is not supported.

    Raises:
        Exception: anything the definition parser raises.
    """
    text = bytes(schema.data).decode()
    check_definition(schema.name, text)
    if schema.encoding == "ros2msg" and schema.name in jazzy_names() and not is_standard(schema):
        _check_fields(schema.name, text)
    with redirect_stderr(StringIO()):  # mcap_ros2 raises, but also prints what it cannot parse
        found = DecoderFactory().decoder_for("cdr", schema)
    return found


def _check_fields(type_name: str, text: str) -> None:
    """Raise ValueError unless a definition has all of Jazzy's fields or is another release's."""
    store, found = jazzy_types(), get_types_from_msg(text, type_name)
    for name in found.keys() & jazzy_names():
        if any(found[name][1] == types.get(name, ((), ()))[1] for types in _releases()):
            continue
        has = dict(found[name][1])
        for field, kind in store.fielddefs[name][1]:
            if has.get(field) != kind:
                raise ValueError(f"{name} without its field {field}, or with another type of it")


@cache
def _releases() -> list[dict[str, Any]]:
    """Type definitions of each ROS 1 and ROS 2 release."""
    return [get_typestore(release).fielddefs for release in Stores]


def is_standard(schema: Schema) -> bool:
    """Whether the definition in the bag has the same fields as Jazzy's, whatever its comments."""
    return schema.encoding == "ros2msg" and _same_fields(schema.name, bytes(schema.data))


@lru_cache(maxsize=256)
def _same_fields(type_name: str, text: bytes) -> bool:
    if type_name not in jazzy_names() or len(text) > LONGEST_DEFINITION:
        return False
    if text.decode(errors="replace") == definition(type_name).text:
        return True
    store = jazzy_types()
    try:
        found = get_types_from_msg(text.decode(), type_name)
        return type_name in found and all(found[n] == store.fielddefs[n] for n in found)
    except Exception:  # the definition parser may raise anything; such a type is not standard
        return False


def decode(raw: RawMessage, decoder: Decoder) -> BagMessage:
    """Decode one raw message.

    Raises:
        MessageError: the bytes do not fit the type; the message names topic and time.
    """
    try:
        if raw.data[1:2] > b"\x01":  # of the representations of DDS, ROS uses 0 and 1 only
            raise ValueError(f"encapsulation {raw.data[:2].hex()}, neither 0000 nor 0001")
        message = decoder(raw.data)
    except Exception as error:  # the decoder may raise any error of struct, numpy and UTF-8
        place = f"topic {raw.topic} at {raw.log_time_ns} ns"
        raise MessageError.about(place, f"a {raw.type}", error, RECOVER) from error
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    stamp_ns = raw.log_time_ns if stamp is None else stamp.sec * NANOSECONDS + stamp.nanosec
    return BagMessage(raw.topic, raw.type, raw.log_time_ns, stamp_ns, message)

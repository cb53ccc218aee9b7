# SPDX-License-Identifier: Apache-2.0
"""One message of a bag, raw and decoded, and the decoders of its types."""

from contextlib import redirect_stderr
from dataclasses import dataclass
from functools import lru_cache
from io import StringIO
from typing import Any

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import get_types_from_msg

from intent_recognition.bags.bounds import LONGEST_DEFINITION, check_definition
from intent_recognition.bags.cdr.columns import COLUMNS
from intent_recognition.bags.cdr.decoder import Decoder, layout_decoder
from intent_recognition.bags.cdr.layout import NANOSECONDS
from intent_recognition.bags.definitions import definition, jazzy_names, jazzy_types
from intent_recognition.errors import MessageError

RECOVER = "Save what is left with `intent recover`."
"""Advice in messages about damaged recordings."""


@dataclass(frozen=True)
class RawMessage:
    """One message as it was recorded.

    Attributes:
        topic: name as recorded.
        type: "package/msg/Name".
        log_time_ns: when it was recorded.
        publish_time_ns: when it was sent.
        data: CDR bytes with their encapsulation header.
        sequence: number given by the publisher, 0 when unknown.
    """

    topic: str
    type: str
    log_time_ns: int
    publish_time_ns: int
    data: bytes
    sequence: int = 0


@dataclass(frozen=True)
class BagMessage:
    """One decoded message.

    Attributes:
        topic: name as recorded.
        type: "package/msg/Name".
        log_time_ns: when it was recorded.
        stamp_ns: stamp of its header, or the log time for a type without header.
        message: an object with the attributes of the type.
    """

    topic: str
    type: str
    log_time_ns: int
    stamp_ns: int
    message: Any


def schema_decoder(schema: Schema) -> Decoder | None:
    """Function from CDR bytes to a message with the attributes of its type.

    None when the definition is in a form that cannot be used.

    Raises:
        Exception: whatever the parser of definitions raises.
    """
    text = bytes(schema.data).decode()
    check_definition(schema.name, text)
    if schema.encoding == "ros2msg" and schema.name in jazzy_names() and not is_standard(schema):
        _check_fields(schema.name, text)
    with redirect_stderr(StringIO()):  # mcap_ros2 prints what it cannot parse, and raises
        found = DecoderFactory().decoder_for("cdr", schema)
    if found and schema.name in COLUMNS and is_standard(schema):
        return layout_decoder(schema.name, found)
    return found


def _check_fields(type_name: str, text: str) -> None:
    """Make sure that a definition has all fields of Jazzy's; it may have more.

    Raises:
        ValueError: it lacks one, or has it with another type.
        Exception: the parser of definitions raises what it meets.
    """
    store, found = jazzy_types(), get_types_from_msg(text, type_name)
    for name in found.keys() & jazzy_names():
        has = dict(found[name][1])
        for field, kind in store.fielddefs[name][1]:
            if has.get(field) != kind:
                raise ValueError(f"{name} without its field {field}, or with another type of it")


def is_standard(schema: Schema) -> bool:
    """Whether the definition in the bag has the fields that Jazzy's has, comments aside."""
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
    except Exception:  # the parser of definitions raises what it meets; not ours to read fast
        return False


def decode(raw: RawMessage, decoder: Decoder) -> BagMessage:
    """Decode one raw message.

    Raises:
        MessageError: the bytes do not fit the type; names topic and time.
    """
    try:
        message = decoder(raw.data)
    except Exception as error:  # the decoder raises what struct, numpy and utf-8 raise
        place = f"topic {raw.topic} at {raw.log_time_ns} ns"
        raise MessageError.about(place, f"a {raw.type}", error, RECOVER) from error
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    stamp_ns = raw.log_time_ns if stamp is None else stamp.sec * NANOSECONDS + stamp.nanosec
    return BagMessage(raw.topic, raw.type, raw.log_time_ns, stamp_ns, message)

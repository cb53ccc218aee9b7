# SPDX-License-Identifier: Apache-2.0
"""Read and write the metadata.yaml of a rosbag2 directory, version 9 (Jazzy)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import yaml

from intent_recognition.durable import commit
from intent_recognition.errors import BagError
from intent_recognition.untrusted import UntrustedError, load_yaml, read_text

FILE_NAME = "metadata.yaml"
RECORD_NAME, RECORD_KEY = "rosbag2", "serialized_metadata"
"""Name and key of the MCAP metadata record that repeats the content of metadata.yaml."""


@dataclass(frozen=True)
class TopicInfo:
    """One topic of a bag."""

    name: str  # topic name as recorded, with its leading slash
    type: str
    message_count: int = 0
    type_hash: str = ""  # RIHS01 hash of the type, "" when unknown
    # QoS profiles in rosbag2's form, empty when unknown
    offered_qos_profiles: tuple[Mapping, ...] = ()


@dataclass(frozen=True)
class BagMetadata:
    """The content of a metadata.yaml."""

    files: tuple[str, ...]  # names of the storage files, in order
    start_ns: int = 0  # log time of the first message; the last is `duration_ns` later
    duration_ns: int = 0
    topics: tuple[TopicInfo, ...] = ()
    # texts that the recorder stored, by key
    custom_data: Mapping[str, str] = field(default_factory=dict)

    @property
    def message_count(self) -> int:
        """Number of messages of all topics."""
        return sum(topic.message_count for topic in self.topics)


class _Dumper(yaml.SafeDumper):
    """Indents lists inside mappings, and repeats equal values, as rosbag2 does."""

    def ignore_aliases(self, data: object) -> bool:
        return True

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:
        super().increase_indent(flow, False)


def dump_yaml(content: object) -> str:
    """YAML in the style of rosbag2: block style, order kept, lists indented."""
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=10**6)


def dump_metadata(metadata: BagMetadata) -> str:
    """The text of the metadata record in the MCAP file."""
    return dump_yaml(_to_dict(metadata))


def parse_custom_data(text: str) -> dict[str, str]:
    """The labels in the metadata record of an MCAP file, empty if the record cannot be read."""
    try:
        return _custom_data(load_yaml(text))
    except (UntrustedError, TypeError, AttributeError):
        return {}


def write_metadata(folder: Path, metadata: BagMetadata) -> None:
    """Write `folder`/metadata.yaml atomically."""
    target = folder / FILE_NAME
    temporary = folder / f".{FILE_NAME}.new"
    content = dump_yaml({"rosbag2_bagfile_information": _to_dict(metadata)})
    temporary.write_text(content, encoding="utf-8")
    commit(temporary, target)


def read_metadata(folder: Path) -> BagMetadata:
    """Read `folder`/metadata.yaml, version 9 or older.

    Raises:
        BagError: the file is missing, is not YAML, or does not describe a bag.
    """
    path = folder / FILE_NAME
    try:
        text = read_text(path)
    except (OSError, UntrustedError) as error:
        raise _error(path, "a readable file", error) from error
    try:
        return _from_dict(load_yaml(text)["rosbag2_bagfile_information"])
    except UntrustedError as error:
        raise _error(path, "YAML", error) from error
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        got = f"none named {error}" if isinstance(error, KeyError) else "others"
        raise _error(path, "the keys of a rosbag2 bag, with their values", got) from error


def _to_dict(metadata: BagMetadata) -> dict[str, object]:
    start = {"nanoseconds_since_epoch": metadata.start_ns}
    duration = {"nanoseconds": metadata.duration_ns}
    count = {"message_count": metadata.message_count}
    return {
        "version": 9,  # as Jazzy's rosbag2 writes it
        "storage_identifier": "mcap",
        "duration": duration,
        "starting_time": start,
        **count,
        "topics_with_message_count": [_topic_to_dict(topic) for topic in metadata.topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": list(metadata.files),
        "files": [
            {"path": name, "starting_time": start, "duration": duration, **count}
            for name in metadata.files
        ],
        "custom_data": dict(metadata.custom_data),
        "ros_distro": "jazzy",
    }


def _topic_to_dict(topic: TopicInfo) -> dict[str, object]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": "cdr",
            "offered_qos_profiles": [dict(profile) for profile in topic.offered_qos_profiles],
            "type_description_hash": topic.type_hash,
        },
        "message_count": topic.message_count,
    }


def _from_dict(info: Mapping) -> BagMetadata:
    return BagMetadata(
        files=tuple(str(name) for name in info["relative_file_paths"] or ()),
        start_ns=_whole(info["starting_time"]["nanoseconds_since_epoch"]),
        duration_ns=_whole(info["duration"]["nanoseconds"]),
        topics=tuple(_topic_from_dict(t) for t in info["topics_with_message_count"] or ()),
        custom_data=_custom_data(info),
    )


def _custom_data(info: Mapping) -> dict[str, str]:
    return {str(k): str(v) for k, v in (info.get("custom_data") or {}).items()}


def _topic_from_dict(item: Mapping) -> TopicInfo:
    topic = item["topic_metadata"]
    return TopicInfo(
        str(topic["name"]),
        str(topic["type"]),
        _whole(item["message_count"]),
        str(topic.get("type_description_hash") or ""),
        parse_qos(topic.get("offered_qos_profiles")),
    )


def _whole(value: object) -> int:
    """A count or a time [ns] that fits a signed 64-bit integer."""
    number = int(value)  # type: ignore[call-overload]
    if not 0 <= number < 2**63:
        raise ValueError(f"{number} is no count or time")
    return number


def _error(path: Path, expected: str, got: object) -> BagError:
    cure = "Save the messages with `intent recover`, which writes a new metadata.yaml."
    return BagError.about(str(path), expected, got, cure)


NO_LIMIT = {"sec": 9223372036, "nsec": 854775807}
"""The longest duration (2^63 - 1 ns), which rmw uses for infinity."""
OLD_NUMBERS = {  # rmw's enumerations, which bags older than version 9 store
    "reliability": {1: "reliable", 2: "best_effort"},
    "durability": {1: "transient_local", 2: "volatile"},
    "history": {1: "keep_last", 2: "keep_all"},
}


def rosbag2_profile(reliability: str, durability: str, depth: int) -> dict[str, object]:
    """One entry of `offered_qos_profiles` in rosbag2's form; a depth of 0 means unknown."""
    return {
        "history": "keep_last" if depth else "unknown",
        "depth": depth,
        "reliability": reliability,
        "durability": durability,
        "deadline": dict(NO_LIMIT),
        "lifespan": dict(NO_LIMIT),
        "liveliness": "automatic",
        "liveliness_lease_duration": dict(NO_LIMIT),
        "avoid_ros_namespace_conventions": False,
    }


def parse_qos(profiles: object) -> tuple[Mapping, ...]:
    """The QoS profiles, given as a list (version 9) or as a string of YAML (older versions)."""
    if isinstance(profiles, str):
        return _parsed_qos(profiles)
    listed = profiles if isinstance(profiles, list) else ()
    return tuple(p for p in listed if isinstance(p, Mapping))


@lru_cache(maxsize=64)  # most topics of most bags have the same
def _parsed_qos(text: str) -> tuple[Mapping, ...]:
    try:
        listed = load_yaml(text)
    except UntrustedError:
        return ()
    return parse_qos(listed) if isinstance(listed, list) else ()


def qos_policy(profile: Mapping, key: str) -> str:
    """Reliability, durability or history of a profile as a word, "" when it is missing."""
    value = profile.get(key)
    return OLD_NUMBERS[key].get(value, "") if isinstance(value, int) else str(value or "")

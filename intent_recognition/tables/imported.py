# SPDX-License-Identifier: Apache-2.0
"""Write imported demonstrations as bags."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.bags import (
    JOINT_STATE,
    NANOSECONDS,
    POSE,
    BagPart,
    BagReader,
    BagWriter,
    cut_bag,
    message_class,
)
from intent_recognition.demonstrations import DofEntry
from intent_recognition.signals import Rejection
from intent_recognition.tables.import_map import Cut, ImportMap


class EntrySamples(NamedTuple):
    """Samples of one entry of the DOF file."""

    entry: DofEntry
    stamps_ns: Integers  # int64 (T,), strictly increasing
    # (T, d) in the unit of the entry, or quaternions (T, 4) for an orientation; NaN where nothing
    # was measured
    values: Floats


@dataclass(frozen=True)
class ImportedDemonstration:
    """One demonstration of a table, to be written as a bag."""

    name: str
    custom_data: Mapping[str, str]  # its label `task`, if it has one, and further texts
    samples: tuple[EntrySamples, ...]  # for each entry of the DOF file
    frame: str = "world"  # frame of poses
    n_dropped: int = 0  # number of samples whose time was missing, or not later than before

    def write(self, folder: Path) -> dict[str, int]:
        """Write the demonstration as a bag in `folder`; returns the message counts by topic.

        Raises:
            ResourceBusyError: the bag exists already.
        """
        counts = {f"/{samples.entry.topic}": 0 for samples in self.samples}
        with BagWriter(folder / self.name, self.custom_data, flush_period_s=None) as writer:
            for stamp_ns, topic, kind, content in _messages(self):
                writer.write_message(topic, kind, content, stamp_ns)
                counts[f"/{topic}"] += 1
        return counts

    def not_measured(self, counts: Mapping[str, int]) -> int:
        """Number of rows without a message, given the message counts by topic."""
        rows: dict[str, int] = {}
        for samples in self.samples:
            topic = f"/{samples.entry.topic}"
            rows[topic] = max(rows.get(topic, 0), samples.stamps_ns.size)
        return sum(count - counts.get(topic, 0) for topic, count in rows.items())


def _messages(demonstration: ImportedDemonstration) -> Iterator[tuple[int, str, str, dict]]:
    """Stamp, topic, type and content of all messages, ordered by time."""
    topics: dict[str, list[EntrySamples]] = {}
    for samples in demonstration.samples:
        topics.setdefault(samples.entry.topic, []).append(samples)
    found = []
    for topic, parts in topics.items():
        kind = parts[0].entry.type
        make = _joint_state if kind == JOINT_STATE and parts[0].entry.joints else _fields
        for stamp, rows in _at_each_stamp(parts).items():
            content = make(rows)
            if content is not None:
                content = _with_header(content, kind, stamp, demonstration.frame)
                found.append((stamp, topic, kind, content))
    yield from sorted(found, key=lambda message: message[:2])


def _at_each_stamp(parts: Sequence[EntrySamples]) -> dict[int, list[tuple[DofEntry, Floats]]]:
    """Values of a topic's entries at each stamp, NaN for entries without a sample there."""
    places = [{int(ns): k for k, ns in enumerate(part.stamps_ns)} for part in parts]
    found = {}
    for stamp in dict.fromkeys(ns for place in places for ns in place):
        found[stamp] = [
            (part.entry, part.values[place[stamp]] if stamp in place
             else np.full(part.values.shape[1], np.nan))
            for part, place in zip(parts, places, strict=True)
        ]  # fmt: skip
    return found


def _joint_state(rows: Sequence[tuple[DofEntry, Floats]]) -> dict[str, Any] | None:
    """Content of a JointState with the measured joints; None if none was measured."""
    found: dict[str, dict[str, float]] = {}
    quantities: dict[str, None] = {}
    for entry, values in rows:
        for joint, value in zip(entry.joints, values.tolist(), strict=True):
            if np.isfinite(value):
                found.setdefault(joint, {})[entry.quantity] = value
                quantities[entry.quantity] = None
    if not found:
        return None
    content: dict[str, Any] = {"name": list(found)}
    for quantity in quantities:
        content[quantity] = [joint.get(quantity, np.nan) for joint in found.values()]
    return content


def _fields(rows: Sequence[tuple[DofEntry, Floats]]) -> dict[str, Any] | None:
    """Content of a message as nested fields; None if a field was not measured."""
    content: dict[str, Any] = {}
    for entry, values in rows:
        if not np.all(np.isfinite(values)):
            return None
        for path, value in zip(entry.fields, values.tolist(), strict=True):
            *parents, last = re.findall(r"\w+", path)
            place = content
            for parent in parents:
                place = place.setdefault(parent, {})
            place[last] = value
    made = _lists(content)
    return made if isinstance(made, dict) else None


def _lists(content: object) -> object:
    """Convert nested mappings from indices to lists."""
    if not isinstance(content, dict):
        return content
    if content and all(key.isdigit() for key in content):
        items = {int(key): _lists(value) for key, value in content.items()}
        return [items.get(k) for k in range(max(items) + 1)]
    return {key: _lists(value) for key, value in content.items()}


def _with_header(content: dict[str, Any], kind: str, stamp_ns: int, frame: str) -> dict[str, Any]:
    if "header" in getattr(message_class(kind), "__dataclass_fields__", {}):
        content = {"header": {"stamp": stamp_ns, "frame_id": frame}, **content}
    pose = content.get("pose", {})
    if kind == POSE and isinstance(pose, dict):
        content["pose"] = {"orientation": {"w": 1.0}, **pose}
    return content


@dataclass(frozen=True)
class ImportedBag:
    """A recording, or a part of one, to be written as a bag."""

    name: str
    custom_data: Mapping[str, str]  # its label `task`, if it has one, and further texts
    source: Path
    start_ns: int  # at or before the log time of its first message
    end_ns: int  # at or after the log time of its last message

    def write(self, folder: Path) -> dict[str, int]:
        """Write the bag in `folder`; returns the message counts by topic, empty without messages.

        Raises:
            ResourceBusyError: the bag exists already.
        """
        part = BagPart(self.start_ns, self.end_ns, folder / self.name, self.custom_data)
        (counts,) = cut_bag(BagReader(self.source), [part])
        return counts


def bag_parts(
    name: str, path: Path, named: Mapping[str, str], mapping: ImportMap
) -> Iterator[ImportedBag | Rejection]:
    """Label and cut a recording by the map, whose cuts are in seconds after the first message."""
    reader = BagReader(path)
    has = {topic.lstrip("/") for topic in reader.topics}
    missing = [c.entry.topic for c in mapping.columns if c.entry.topic.lstrip("/") not in has]
    if missing:
        there = ", ".join(sorted(reader.topics)) or "none"
        yield Rejection(name, f"/{missing[0]}", 0, f"missing topic; the recording has {there}")
        return
    start_ns, end_ns = reader.start_ns, reader.end_ns
    cuts = mapping.segments if isinstance(mapping.segments, tuple) else ()
    own: list[Cut | None] = [cut for cut in cuts if cut.file in ("", name)]
    own = own if cuts else [None]
    fixed = {key: text.fixed for key, text in mapping.metadata.items() if text.fixed}
    whole = mapping.task.fixed if mapping.task is not None else named.get("task", "")
    for k, cut in enumerate(own):
        task = mapping.label_of(cut, whole or reader.custom_data.get("task", ""))
        texts = {**reader.custom_data, **named, "imported_from": path.name, **fixed}
        texts.pop("task", None)
        first_ns, last_ns = start_ns, end_ns
        if cut is not None:
            first_ns = start_ns + round(cut.start_s * NANOSECONDS)
            last_ns = start_ns + round(cut.end_s * NANOSECONDS)
        yield ImportedBag(
            name if len(own) == 1 else f"{name}_{k:03d}",
            texts | ({"task": task} if task else {}),
            path,
            first_ns,
            last_ns,
        )

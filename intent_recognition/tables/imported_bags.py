# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS 1 and ROS 2 that get a label, or are cut: message by message as they are."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from intent_recognition.bags import NANOSECONDS, BagPart, BagReader, cut_bag
from intent_recognition.signals import Rejection
from intent_recognition.tables.import_map import Cut, ImportMap


@dataclass(frozen=True)
class ImportedBag:
    """A recording, or a part of one, to be written as a bag.

    Attributes:
        custom_data: its label `task`, where it has one, and further texts.
        start_ns: log time of its first message, or earlier.
        end_ns: log time of its last message, or later.
    """

    name: str
    custom_data: Mapping[str, str]
    source: Path
    start_ns: int
    end_ns: int

    def write(self, folder: Path) -> dict[str, int]:
        """Write it below a folder; returns the messages by topic.

        Raises:
            ResourceBusyError: it exists already.
        """
        reader = BagReader(self.source)
        path = folder / self.name
        cut_bag(reader, [BagPart(self.start_ns, self.end_ns, path, self.custom_data)])
        return {topic.name: topic.message_count for topic in BagReader(path).topics.values()}


def bag_parts(
    name: str, path: Path, named: Mapping[str, str], mapping: ImportMap
) -> Iterator[ImportedBag | Rejection]:
    """A recording as the map labels and cuts it, in seconds from its first message."""
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
    for k, cut in enumerate(own):
        task = _label(cut, mapping, named, reader.custom_data)
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


def _label(
    cut: Cut | None, mapping: ImportMap, named: Mapping[str, str], said: Mapping[str, str]
) -> str:
    whole = mapping.task.fixed if mapping.task is not None else named.get("task", "")
    label = (cut.task if cut is not None else "") or whole or said.get("task", "")
    return mapping.labels.get(label, label)

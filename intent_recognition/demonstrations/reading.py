# SPDX-License-Identifier: Apache-2.0
"""Demonstrations from bags, folders of bags and session bags, and what could not be used."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from intent_recognition.bags import FILE_NAME, BagMessage, BagReader
from intent_recognition.demonstrations.dofs import DofSpec, relative_topic
from intent_recognition.demonstrations.sessions import find_marker_topic, split_session
from intent_recognition.demonstrations.signals import (
    TopicSamples,
    clean_columns,
    clean_topic,
    signals_of,
)
from intent_recognition.demonstrations.topic_values import ORIENTATION_FIELDS, has_columns
from intent_recognition.errors import BagError, MessageError
from intent_recognition.signals import Demonstration, Rejection, Signal

MIN_SAMPLES = 2
Paths = str | Path | Iterable[str | Path]


def read_demonstrations(
    paths: Paths, dofs: DofSpec, *, extrinsics: Mapping[str, tuple] | None = None
) -> tuple[list[Demonstration], list[Rejection]]:
    """All demonstrations below `paths`, and why others are left out.

    Args:
        paths: bags, folders of bags (sorted by name, searched to any depth) or session bags, one
            or many.
        dofs: topics and fields to read.
        extrinsics: pose of each tracker frame in the world, as in `tracking.ingest`. Without it
            the frame of each recording counts as the world.

    Raises:
        BagError: a path does not exist.
    """
    demonstrations, rejections = [], []
    for found in iter_demonstrations(paths, dofs, extrinsics=extrinsics):
        (demonstrations if isinstance(found, Demonstration) else rejections).append(found)
    return demonstrations, rejections


def iter_demonstrations(
    paths: Paths, dofs: DofSpec, *, extrinsics: Mapping[str, tuple] | None = None
) -> Iterator[Demonstration | Rejection]:
    """The same one by one, in order, for progress bars and long lists."""
    for path in [Path(p) for p in ([paths] if isinstance(paths, str | Path) else paths)]:
        bags = find_bags(path)
        if not bags:
            yield Rejection(str(path), "", 0, "there is no bag in this folder")
        for bag in bags:
            yield from _read_bag(bag, dofs, extrinsics)


def find_bags(path: Path) -> list[Path]:
    """The bag `path` is, or all bags below it, sorted by name.

    Raises:
        BagError: the path does not exist.
    """
    if not path.exists():
        raise BagError(f"{path}: expected a bag or a folder of bags, got nothing. Check the path.")
    if path.is_file() or _is_bag(path):
        return [path]
    folders = sorted(f for f in path.iterdir() if f.is_dir() and not f.name.startswith("."))
    return [bag for folder in folders for bag in find_bags(folder)]


def _is_bag(folder: Path) -> bool:
    return (folder / FILE_NAME).exists() or any(folder.glob("*.mcap"))


def _read_bag(
    path: Path, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> Iterator[Demonstration | Rejection]:
    try:
        reader = BagReader(path)
        marker = find_marker_topic(reader)
        problem = _missing_topic(reader, dofs)
        if problem is None and marker is None and not reader.is_finished and not reader.damage:
            problem = Rejection(str(path), "", reader.end_ns, _UNFINISHED)
    except BagError as error:
        yield Rejection(str(path), "", 0, str(error))
        return
    if problem is not None:
        yield problem
        return
    samples, markers, damage = _collect(reader, dofs, marker, extrinsics)
    if damage is not None and marker is None:
        yield damage
        return
    if marker is None:
        yield _whole_bag(reader, dofs, samples)
        return
    for part in split_session(markers, samples, str(path)):
        if isinstance(part, Rejection):
            yield part
        else:
            yield _part_of_session(reader, dofs, samples, part)
    if damage is not None:
        yield damage


_UNFINISHED = (
    "unfinished: the recording was not closed, its end may be missing; "
    "`intent recover` makes a whole bag of what is there"
)


def _missing_topic(reader: BagReader, dofs: DofSpec) -> Rejection | None:
    recorded = {relative_topic(name): info for name, info in reader.topics.items()}
    for topic, kind in dofs.topics.items():
        if topic not in recorded:
            has = ", ".join(sorted(recorded)) or "nothing"
            reason = f"missing topic: the bag has {has}"
        elif recorded[topic].type != kind:
            reason = f"wrong schema: expected {kind}, recorded as {recorded[topic].type}"
        elif recorded[topic].message_count == 0:
            reason = "empty: no message was recorded on this topic"
        else:
            continue
        return Rejection(str(reader.path), f"/{topic}", reader.start_ns, reason)
    return None


def _collect(
    reader: BagReader, dofs: DofSpec, marker: str | None, extrinsics: Mapping[str, tuple] | None
) -> tuple[dict[str, TopicSamples], list[BagMessage], Rejection | None]:
    """Samples by relative topic and markers up to the first damage, and what that was."""
    marker_topics = [marker] if marker else []
    try:
        samples = _columns(reader, dofs, extrinsics)
        if samples is not None:
            return samples, list(reader.messages(marker_topics)) if marker else [], None
    except BagError:  # message by message it comes out how far the recording is good
        pass
    messages: dict[str, list[BagMessage]] = {t: [] for t in [*dofs.topics, *marker_topics]}
    last_ns, damage = 0, None
    try:
        for message in reader.messages(messages):
            messages[relative_topic(message.topic)].append(message)
            last_ns = message.log_time_ns
    except MessageError as error:
        damage = Rejection(str(reader.path), "", last_ns, f"wrong schema: {error}")
    except BagError as error:
        damage = Rejection(str(reader.path), "", last_ns, f"damaged: {error}")
    samples = {
        topic: clean_topic(topic, kind, messages[topic], extrinsics)
        for topic, kind in dofs.topics.items()
    }
    return samples, messages[marker] if marker else [], damage


def _columns(
    reader: BagReader, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> dict[str, TopicSamples] | None:
    """Samples of all topics by columns, None if there is a topic that has none."""
    entries = (*dofs.observed, *dofs.controlled)
    if not all(map(has_columns, entries)):
        return None
    columns = reader.columns(dofs.topics)
    if any(found is None for found in columns.values()):
        return None
    fields = {topic: set() for topic in dofs.topics}
    for entry in entries:
        fields[entry.topic].update(entry.fields)
    return {
        topic: clean_columns(
            topic, found, extrinsics, oriented=not fields[topic].isdisjoint(ORIENTATION_FIELDS)
        )
        for topic, found in columns.items()
    }


def _whole_bag(
    reader: BagReader, dofs: DofSpec, samples: Mapping[str, TopicSamples]
) -> Demonstration | Rejection:
    observed, controlled, rejected = signals_of(dofs, samples)
    problem = _too_short(reader, dofs, (*observed, *controlled), rejected, reader.start_ns)
    if problem:
        return problem
    metadata = reader.custom_data
    metadata.pop("task", None)
    return Demonstration(
        name=reader.path.stem if reader.path.is_file() else reader.path.resolve().name,
        source=str(reader.path),
        task=reader.custom_data.get("task") or None,
        observed=observed,
        controlled=controlled,
        start_ns=int(min(signal.stamps_ns[0] for signal in observed)),
        end_ns=int(max(signal.stamps_ns[-1] for signal in observed)),
        metadata=metadata,
        rejected=rejected,
    )


def _part_of_session(
    reader: BagReader, dofs: DofSpec, samples: Mapping[str, TopicSamples], part
) -> Demonstration | Rejection:
    observed, controlled, rejected = signals_of(
        dofs, samples, part.start_ns, part.end_ns, count_topics=part.index == 0
    )
    problem = _too_short(reader, dofs, (*observed, *controlled), rejected, part.start_ns)
    if problem:
        return problem
    metadata = reader.custom_data
    metadata.pop("task", None)
    return Demonstration(
        name=f"{reader.path.resolve().name}#{part.index:03d}",
        source=str(reader.path),
        task=part.task,
        observed=observed,
        controlled=controlled,
        start_ns=part.start_ns,
        end_ns=part.end_ns,
        metadata=metadata,
        rejected=rejected,
    )


def _too_short(
    reader: BagReader,
    dofs: DofSpec,
    signals: Sequence[Signal],
    rejected: Counter[str],
    start_ns: int,
) -> Rejection | None:
    for entry, signal in zip((*dofs.observed, *dofs.controlled), signals, strict=True):
        if signal.stamps_ns.size < MIN_SAMPLES:
            dropped = ", ".join(f"{n} {reason}" for reason, n in sorted(rejected.items()) if n)
            reason = f"empty: {signal.stamps_ns.size} usable samples ({dropped or 'none dropped'})"
            return Rejection(str(reader.path), f"/{entry.topic}", int(start_ns), reason)
    if not np.any([s.stamps_ns[-1] > s.stamps_ns[0] for s in signals]):
        return Rejection(str(reader.path), "", int(start_ns), "empty: the recording has no length")
    return None

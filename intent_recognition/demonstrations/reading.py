# SPDX-License-Identifier: Apache-2.0
"""Demonstrations and task sequences from bags, folders of bags and session bags."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags import FILE_NAME, BagMessage, BagReader
from intent_recognition.demonstrations.cleaning import (
    TopicSamples,
    clean_columns,
    clean_topic,
    context_of,
    restamped,
    signals_of,
)
from intent_recognition.demonstrations.dofs import DofSpec, relative_topic
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import (
    ORIENTATION_FIELDS,
    extract_present,
    has_columns,
    reference_of,
    stamp_of,
)
from intent_recognition.demonstrations.hand_poses import as_hands, hand_numbers, read_by_joints
from intent_recognition.demonstrations.labels import label_problem
from intent_recognition.demonstrations.paths import element_names
from intent_recognition.demonstrations.sessions import (
    ACTIVE_TOPIC,
    MARKER_TOPIC,
    SessionPart,
    TaskSequence,
    find_marker_topic,
    split_session,
    task_of,
    task_sequences,
)
from intent_recognition.errors import (
    ArgumentError,
    BagError,
    DofError,
    MessageError,
    describe,
)
from intent_recognition.signals import (
    Demonstration,
    Rejection,
    Signal,
    mean_orientation,
    stream_defect,
)
from intent_recognition.tracking import JUMP

REFERENCE_BAGS = 50
"""Recordings from which the mean orientation is taken. Convention: the mean need not be exact."""
LEAST_SAMPLES = 2
"""Samples of each signal, fewer of which are not a movement. Convention: one span of time."""
UNFINISHED = (
    "unfinished: the recording was not closed, its end may be missing; "
    "`intent recover` makes a whole bag of what is there"
)
NO_BAG = "there is no bag in this folder"
Paths = str | Path | Iterable[str | Path]


def read_demonstrations(
    paths: Paths, dofs: DofSpec, *, extrinsics: Mapping[str, tuple] | None = None
) -> tuple[list[Demonstration], list[Rejection]]:
    """Read all demonstrations below `paths`.

    Raw tracker poses are checked and transformed to the world frame as the node `mocap_ingest`
    does it; messages with bad stamps, missing joints, NaN or infinity are dropped and counted.

    Args:
        paths: one or more bags, session bags (which hold several demonstrations) or folders of
            bags, which are searched to any depth and sorted by name.
        dofs: topics and fields to read, see `load_dofs`.
        extrinsics: by tracker frame its position (3,) [m] and orientation xyzw (4,) in the world.
            Without it the frame of each recording counts as the world.

    Returns:
        The demonstrations, and for each recording or part that is left out the reason.

    Raises:
        BagError: a path does not exist.
        DofError: an orientation has no reference, see `settle_orientations`.
    """
    demonstrations: list[Demonstration] = []
    rejections: list[Rejection] = []
    for found in iter_demonstrations(paths, dofs, extrinsics=extrinsics):
        if isinstance(found, Demonstration):
            demonstrations.append(found)
        else:
            rejections.append(found)
    return demonstrations, rejections


def iter_demonstrations(
    paths: Paths, dofs: DofSpec, *, extrinsics: Mapping[str, tuple] | None = None
) -> Iterator[Demonstration | Rejection]:
    """As `read_demonstrations`, one by one in the same order."""
    for entry in dofs.recorded:
        if entry.orientation:
            reference_of(entry)
    for path in _as_paths(paths):
        bags = find_bags(path)
        if not bags:
            yield Rejection(str(path), "", 0, NO_BAG)
        for bag in bags:
            yield from _read_bag(bag, dofs, extrinsics)


def settle_orientations(dofs: DofSpec, paths: Paths) -> DofSpec:
    """The same DOFs, with a reference for every orientation that has none: the mean of recordings.

    Args:
        dofs: topics and fields to read.
        paths: bags and folders of bags, of which at most `REFERENCE_BAGS` are read.

    Raises:
        BagError: a path does not exist.
        DofError: no recording has an orientation that was measured.
    """
    if all(entry.reference for entry in dofs.recorded if entry.orientation):
        return dofs
    bags = [bag for path in _as_paths(paths) for bag in find_bags(path)]
    readers = [*map(_sound_reader, bags[:: -(-len(bags) // REFERENCE_BAGS) or 1])]

    def settled(entry: DofEntry) -> DofEntry:
        if not entry.orientation or entry.reference:
            return entry
        found = [mean for reader in readers if (mean := _mean_in(reader, entry)) is not None]
        if not found:
            got = f"none in {len(readers)} of the recordings"
            cure = "Record orientations, or give the entry a reference."
            raise DofError(describe(entry.names[0], "orientations to take the mean of", got, cure))
        return replace(entry, reference=tuple(mean_orientation(found).tolist()))

    return replace(
        dofs,
        observed=tuple(map(settled, dofs.observed)),
        controlled=tuple(map(settled, dofs.controlled)),
        context=tuple(map(settled, dofs.context)),
    )


def _sound_reader(path: Path) -> BagReader | None:
    try:
        return BagReader(path)
    except BagError:  # what is wrong is said when it is read
        return None


def _mean_in(reader: BagReader | None, entry: DofEntry) -> NDArray[np.float64] | None:
    """Mean orientation (4,) in a recording; None where there is none."""
    if reader is None:
        return None
    dofs, arms = read_by_joints(reader, DofSpec((), (entry,)))
    source = replace(dofs.controlled[0], orientation="")
    try:
        numbers = [
            extract_present(source, message.message)
            for message in reader.messages([source.topic])
            if stamp_of(source, message.message, message.log_time_ns) is not None
        ]
        if arms and numbers:
            return mean_orientation(hand_numbers(entry, arms[0].forward_kinematics(numbers)))
        return mean_orientation(numbers)
    except (ArgumentError, BagError):
        return None


def _as_paths(paths: Paths) -> list[Path]:
    return [Path(p) for p in ([paths] if isinstance(paths, str | Path) else paths)]


def read_whole(path: str | Path, dofs: DofSpec) -> Demonstration:
    """A recording as one, whatever parts its markers divide it into.

    Of the controlled agent only the topics that the recording has are read, of the context none.

    Args:
        path: of one bag.
        dofs: topics and fields to read.

    Raises:
        BagError: it is not one bag, is damaged, or a topic of the observed agent cannot be read.
    """
    bags = find_bags(Path(path))
    if len(bags) != 1:
        cure = "Give one session bag."
        raise BagError(describe(str(path), "one bag", f"{len(bags)} of them", cure))
    reader = BagReader(bags[0])
    recorded = set(map(relative_topic, reader.topics))
    dofs = replace(
        dofs, controlled=tuple(e for e in dofs.controlled if e.topic in recorded), context=()
    )
    problem: Rejection | None = _missing_topic(reader, dofs)
    if problem is None:
        samples, _, problem = _collect(reader, dofs, None, None)
    found = problem or _demonstration(reader, dofs, samples)
    if isinstance(found, Rejection):
        raise BagError(str(found))
    return found


def read_task_sequences(
    paths: Iterable[str | Path], forget_after_s: float
) -> tuple[list[TaskSequence], list[Rejection]]:
    """Which task followed which in all session bags below `paths`.

    Args:
        paths: session bags and folders of such, searched to any depth.
        forget_after_s: a longer pause between two tasks ends a sequence [s].

    Returns:
        The sequences, and why other bags have none.

    Raises:
        BagError: a path does not exist.
    """
    sequences: list[TaskSequence] = []
    rejections: list[Rejection] = []
    for path in map(Path, paths):
        bags = find_bags(path)
        if not bags:
            rejections.append(Rejection(str(path), "", 0, NO_BAG))
        for bag in bags:
            try:
                found = list(task_sequences(BagReader(bag), forget_after_s))
            except BagError as error:
                rejections.append(Rejection(str(bag), "", 0, str(error)))
                continue
            sequences += found
            if not found:
                reason = f"no session: nothing on {MARKER_TOPIC} nor on {ACTIVE_TOPIC}"
                rejections.append(Rejection(str(bag), "", 0, reason))
    return sequences, rejections


def find_bags(path: Path, above: frozenset[Path] = frozenset()) -> list[Path]:
    """The bag `path` is, or all bags below it, sorted by name.

    Args:
        path: a bag, a file or a folder.
        above: folders that it lies in, with links resolved; a link to one of them is not followed.

    Raises:
        BagError: the path does not exist.
    """
    if not path.exists():
        raise BagError(f"{path}: expected a bag or a folder of bags, got nothing. Check the path.")
    if path.is_file() or _is_bag(path):
        return [path]
    folders = sorted(f for f in path.iterdir() if f.is_dir() and not f.name.startswith("."))
    inside = above | {path.resolve()}
    return [
        bag
        for folder in folders
        if folder.resolve() not in inside
        for bag in find_bags(folder, inside)
    ]


def _is_bag(folder: Path) -> bool:
    return (folder / FILE_NAME).exists() or any(folder.glob("*.mcap"))


def _read_bag(
    path: Path, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> Iterator[Demonstration | Rejection]:
    asked = dofs
    try:
        reader = BagReader(path)
        marker = find_marker_topic(reader)
        dofs, arms = read_by_joints(reader, asked)
        problem = _missing_topic(reader, dofs)
        if problem is None and marker is None and not reader.is_finished and not reader.damage:
            problem = Rejection(str(path), "", reader.end_ns, UNFINISHED)
    except BagError as error:
        yield Rejection(str(path), "", 0, str(error))
        return
    if problem is not None:
        yield problem
        return
    for found in _parts(reader, dofs, marker, extrinsics):
        yield as_hands(found, asked, arms) if isinstance(found, Demonstration) else found


def _parts(
    reader: BagReader, dofs: DofSpec, marker: str | None, extrinsics: Mapping[str, tuple] | None
) -> Iterator[Demonstration | Rejection]:
    samples, markers, damage = _collect(reader, dofs, marker, extrinsics)
    if damage is not None and marker is None:
        yield damage
        return
    if marker is None:
        yield _demonstration(reader, dofs, samples)
        return
    for part in split_session(markers, samples, str(reader.path)):
        if isinstance(part, Rejection):
            yield part
        else:
            yield _demonstration(reader, dofs, samples, part)
    if damage is not None:
        yield damage


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
    """Samples by relative topic and markers before the first damage, and what is damaged."""
    marker_topics = [marker] if marker else []
    try:
        samples = _columns(reader, dofs, extrinsics)
        if samples is not None:
            return samples, list(reader.messages(marker_topics)) if marker else [], None
    except BagError:  # read message by message, to know how far the recording can be read
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
    samples = {}
    for stream, entry in dofs.streams.items():
        recorded = messages[entry.topic]
        about = [m for m in (restamped(entry, message) for message in recorded) if m is not None]
        if recorded and not about and damage is None:
            has = {name for m in recorded for name in element_names(m.message, entry.fields)}
            reason = (
                f"no {', '.join(entry.fields)}: the topic has {', '.join(sorted(has)) or 'none'}"
            )
            damage = Rejection(str(reader.path), f"/{entry.topic}", 0, reason)
        samples[stream] = clean_topic(entry.topic, entry.type, about, extrinsics)
    return samples, messages[marker] if marker else [], damage


def _columns(
    reader: BagReader, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> dict[str, TopicSamples] | None:
    """Samples of all topics read as columns; None if one of them cannot be."""
    entries = dofs.recorded
    if not all(map(has_columns, entries)):
        return None
    columns = reader.columns(dofs.topics)
    if any(found is None for found in columns.values()):
        return None
    oriented = {
        entry.topic for entry in entries if not set(entry.fields).isdisjoint(ORIENTATION_FIELDS)
    }
    return {
        topic: clean_columns(topic, found, extrinsics, oriented=topic in oriented)
        for topic, found in columns.items()
        if found is not None
    }


def _demonstration(
    reader: BagReader,
    dofs: DofSpec,
    samples: Mapping[str, TopicSamples],
    part: SessionPart | None = None,
) -> Demonstration | Rejection:
    """The demonstration in a whole bag, or in a part of a session."""
    if part is None:
        observed, controlled, rejected = signals_of(dofs, samples)
        start_ns = reader.start_ns
    else:
        observed, controlled, rejected = signals_of(
            dofs, samples, part.start_ns, part.end_ns, count_topics=part.index == 0
        )
        start_ns = part.start_ns
    problem = _too_short(reader, dofs, samples, (*observed, *controlled), rejected, start_ns)
    if problem is not None:
        return problem
    metadata = reader.custom_data
    metadata.pop("task", None)
    folder = reader.path.resolve().name
    if part is None:
        name = reader.path.stem if reader.path.is_file() else folder
        task = task_of(reader)
        if task and (bad := label_problem(task)):
            return Rejection(str(reader.path), "", 0, bad)
        start_ns = int(min(signal.stamps_ns[0] for signal in observed))
        end_ns = int(max(signal.stamps_ns[-1] for signal in observed))
    else:
        name, task, end_ns = f"{folder}#{part.index:03d}", part.task, part.end_ns
    context = context_of(dofs, samples, start_ns, end_ns)
    for entry, signal in zip(dofs.context, context, strict=True):
        if not signal.stamps_ns.size:
            reason = "empty: nothing of the context was recorded before the end of the movement"
            return Rejection(str(reader.path), f"/{entry.topic}", int(start_ns), reason)
    delays_s = tuple(
        float(np.median(samples[entry.stream].log_times_ns - samples[entry.stream].stamps_ns))
        * 1e-9
        for entry in (*dofs.observed, *dofs.controlled)
    )
    found = Demonstration(
        name, str(reader.path), task, observed, controlled, start_ns, end_ns, metadata, rejected,
        delays_s, context,
    )  # fmt: skip
    reason = stream_defect(found)
    at_ns = 0 if part is None else start_ns
    return Rejection(str(reader.path), "", at_ns, reason) if reason else found


def _too_short(
    reader: BagReader,
    dofs: DofSpec,
    samples: Mapping[str, TopicSamples],
    signals: Sequence[Signal],
    rejected: Counter[str],
    start_ns: int,
) -> Rejection | None:
    for entry, signal in zip((*dofs.observed, *dofs.controlled), signals, strict=True):
        if signal.stamps_ns.size < LEAST_SAMPLES:
            dropped = ", ".join(f"{n} {reason}" for reason, n in sorted(rejected.items()) if n)
            reason = f"empty: {signal.stamps_ns.size} usable samples ({dropped or 'none dropped'})"
            if rejected[JUMP] > LEAST_SAMPLES:
                reason += "; likely millimetres for metres"
            elif samples[entry.stream].stamps_ns.size >= LEAST_SAMPLES > signal.stamps_ns.size:
                reason += "; the topic has others, before or after: likely two clocks"
            return Rejection(str(reader.path), f"/{entry.topic}", int(start_ns), reason)
    if not np.any([s.stamps_ns[-1] > s.stamps_ns[0] for s in signals]):
        return Rejection(str(reader.path), "", int(start_ns), "empty: the recording has no length")
    return None

# SPDX-License-Identifier: Apache-2.0
"""Read demonstrations from bags, folders of bags and session bags."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from intent_recognition.bags import RECOVER, BagReader
from intent_recognition.demonstrations.cleaning import (
    MISSING_DOF,
    TopicSamples,
    context_of,
    signal_of,
    signals_of,
)
from intent_recognition.demonstrations.collecting import collect, missing_topic
from intent_recognition.demonstrations.dofs import QUANTITIES, DofSpec, relative_topic
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import joint_indices, reference_of
from intent_recognition.demonstrations.folders import (
    Paths,
    as_paths,
    find_bags,
    label_problem,
    no_bag,
)
from intent_recognition.demonstrations.hand_poses import as_hands, known_of, read_by_joints
from intent_recognition.demonstrations.paths import ElementAbsentError, follow, parse_path
from intent_recognition.demonstrations.sessions import (
    SessionPart,
    find_marker_topic,
    split_session,
    task_of,
)
from intent_recognition.errors import BagError, check_type
from intent_recognition.signals import Demonstration, Known, Rejection, Signal, stream_defect
from intent_recognition.tracking import JUMP

LEAST_SAMPLES = 2
"""Fewest samples of each signal in a demonstration; two samples span a time."""
FIRST_MESSAGES = 1000
"""Number of messages searched for joints, enough to include every publisher."""
CURES = {
    "zero_stamp": "Fill in header.stamp before publishing.",
    "unknown_frame": "Name its frame under extrinsics in the DOF file.",
}
"""Advice by reason for which messages are dropped."""
UNFINISHED = "unfinished: the recording was not closed, its end may be missing"


def read_demonstrations(
    paths: Paths, dofs: DofSpec, *, extrinsics: Mapping[str, tuple] | None = None
) -> tuple[list[Demonstration], list[Rejection]]:
    """Read all demonstrations below `paths`.

    Raw tracker poses are checked and transformed to the world frame as in the node `mocap_ingest`;
    messages with bad stamps, missing joints, NaN or infinity are dropped and counted.

    Args:
        paths: one or more bags, session bags (which hold several demonstrations) or folders of
            bags, which are searched to any depth and sorted by name.
        dofs: topics and fields to read, see `load_dofs`.
        extrinsics: position (3,) [m] and orientation xyzw (4,) in the world, by tracker frame. The
            default is that of the DOF file; without either, the frame of each recording is used as
            the world.

    Returns:
        The demonstrations, and the reason for each recording or part that is left out.

    Raises:
        ArgumentError: dofs is not a `DofSpec`.
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
    """Like `read_demonstrations`, but yields demonstrations and rejections one by one."""
    check_type("dofs", dofs, DofSpec, "Read it with `load_dofs(path)`, and pass it after the bags.")
    for entry in dofs.recorded:
        if entry.orientation:
            reference_of(entry)
    extrinsics = dofs.tracker_frames if extrinsics is None else extrinsics
    for path in as_paths(paths):
        bags = find_bags(path)
        if not bags:
            yield no_bag(path)
        for bag in bags:
            yield from _read_bag(bag, dofs, extrinsics)


def read_whole(path: str | Path, dofs: DofSpec) -> Demonstration:
    """Read a recording as one demonstration, ignoring its markers.

    Controlled topics that were not recorded, and the context, are left out.

    Raises:
        BagError: `path` is not one bag, the bag is damaged, or a topic cannot be read.
    """
    bags = find_bags(Path(path))
    if len(bags) != 1:
        cure = "Give one session bag."
        raise BagError.about(str(path), "one bag", f"{len(bags)} of them", cure)
    reader = BagReader(bags[0])
    recorded = set(map(relative_topic, reader.topics))
    dofs = replace(
        dofs, controlled=tuple(e for e in dofs.controlled if e.topic in recorded), context=()
    )
    problem: Rejection | None = missing_topic(reader, dofs)
    if problem is None:
        samples, _, problem = collect(reader, dofs, None, dofs.tracker_frames)
    found = problem or _demonstration(reader, dofs, samples, known_of(reader, dofs))
    if isinstance(found, Rejection):
        raise BagError(str(found))
    return found


def _read_bag(
    path: Path, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> Iterator[Demonstration | Rejection]:
    asked = dofs
    try:
        reader = BagReader(path)
        marker = find_marker_topic(reader)
        dofs, arms = read_by_joints(reader, asked)
        problem = missing_topic(reader, dofs)
        if problem is None and marker is None and not reader.is_finished and not reader.damage:
            problem = Rejection(str(path), "", reader.end_ns, UNFINISHED, RECOVER)
    except BagError as error:
        problem = Rejection.of(str(path), error)
    if problem is not None:
        yield problem
        return
    samples, markers, damage = collect(reader, dofs, marker, extrinsics)
    parts: Iterable[SessionPart | Rejection | None] = [None]
    if marker is not None:
        parts = split_session(markers, samples, str(reader.path))
    elif damage is not None:
        parts = ()
    known = known_of(reader, dofs)
    for part in parts:
        if isinstance(part, Rejection):
            yield part
            continue
        found = _demonstration(reader, dofs, samples, known, part)
        yield as_hands(found, asked, arms) if isinstance(found, Demonstration) else found
    if damage is not None:
        yield damage


def _demonstration(
    reader: BagReader,
    dofs: DofSpec,
    samples: Mapping[str, TopicSamples],
    known: tuple[Known | None, ...],
    part: SessionPart | None = None,
) -> Demonstration | Rejection:
    """The demonstration in a whole bag or in a part of a session."""
    between = (part.start_ns, part.end_ns) if part else (None, None)
    first = part is None or part.index == 0
    observed, controlled, rejected = signals_of(dofs, samples, *between, count_topics=first)
    problem = _too_short(reader, dofs, samples, (*observed, *controlled), part)
    if problem is not None:
        return problem
    metadata = reader.custom_data
    metadata.pop("task", None)
    folder = reader.path.resolve().name
    if part is None:
        name = reader.path.stem if reader.path.is_file() else folder
        task = task_of(reader)
        if task and (bad := label_problem(task, str(reader.path))):
            return bad
        start_ns = int(min(signal.stamps_ns[0] for signal in observed))
        end_ns = int(max(signal.stamps_ns[-1] for signal in observed))
    else:
        name, task = f"{folder}#{part.index:03d}", part.task
        start_ns, end_ns = part.start_ns, part.end_ns
    context = context_of(dofs, samples, start_ns, end_ns)
    for entry, signal in zip(dofs.context, context, strict=True):
        if not signal.stamps_ns.size:
            reason = "empty: nothing of the context was recorded before the end of the movement"
            return Rejection(str(reader.path), f"/{entry.topic}", int(start_ns), reason)
    streams = [samples[entry.stream] for entry in (*dofs.observed, *dofs.controlled)]
    delays_s = tuple(float(np.median(s.log_times_ns - s.stamps_ns)) * 1e-9 for s in streams)
    found = Demonstration(
        name, str(reader.path), task, observed, controlled, start_ns, end_ns, metadata, rejected,
        delays_s, context, _frames(dofs, samples), known,
    )  # fmt: skip
    reason = stream_defect(found)
    at_ns = 0 if part is None else start_ns
    return Rejection(str(reader.path), "", at_ns, reason) if reason else found


def _frames(dofs: DofSpec, samples: Mapping[str, TopicSamples]) -> dict[str, tuple[str, ...]]:
    """Frames of the topics that name any."""
    entries = [entry for entry in dofs.recorded if entry.fields]
    entries.sort(key=lambda entry: len(samples[entry.stream].frames))  # the last of a topic stays
    return {e.topic: frames for e in entries if (frames := samples[e.stream].frames)}


def _too_short(
    reader: BagReader,
    dofs: DofSpec,
    samples: Mapping[str, TopicSamples],
    signals: Sequence[Signal],
    part: SessionPart | None,
) -> Rejection | None:
    start_ns, end_ns = (part.start_ns, part.end_ns) if part else (None, None)
    at_ns = 0 if part is None else part.start_ns
    for entry, signal in zip((*dofs.observed, *dofs.controlled), signals, strict=True):
        if signal.stamps_ns.size < LEAST_SAMPLES:
            rejected = signal_of(entry, samples[entry.stream], start_ns, end_ns)[1]
            n_inside = signal.stamps_ns.size + rejected.total()
            if part is None or part.index == 0:  # as `signals_of` counts
                rejected.update(samples[entry.stream].rejected)
            dropped = ", ".join(f"{n} {reason}" for reason, n in sorted(rejected.items()) if n)
            reason = f"empty: {signal.stamps_ns.size} usable samples ({dropped or 'none dropped'})"
            if rejected[MISSING_DOF] and (absent := _absent(reader, entry)):
                return Rejection(str(reader.path), f"/{entry.topic}", 0, absent)
            if rejected[JUMP] > LEAST_SAMPLES:
                reason += "; likely millimetres for metres"
            elif samples[entry.stream].stamps_ns.size >= LEAST_SAMPLES > n_inside:
                reason += "; the topic has others, before or after: likely two clocks"
            cure = next((text for why, text in CURES.items() if rejected[why]), "")
            return Rejection(str(reader.path), f"/{entry.topic}", at_ns, reason, cure)
    if not np.any([s.stamps_ns[-1] > s.stamps_ns[0] for s in signals]):
        return Rejection(str(reader.path), "", at_ns, "empty: the recording has no length")
    return None


def _absent(reader: BagReader, entry: DofEntry) -> str:
    """Text naming the joints or fields of an entry that the first messages lack; else empty."""
    try:
        messages = [m.message for m in islice(reader.messages([entry.topic]), FIRST_MESSAGES)]
    except BagError:
        return ""
    if entry.joints:
        return _absent_joints(entry, messages)
    absent = [f for f in entry.fields if not all(_has(m, f) for m in messages[:1])]
    return f"no field {', '.join(absent)} in {entry.type}" if absent else ""


def _absent_joints(entry: DofEntry, messages: Sequence[Any]) -> str:
    groups = [*dict.fromkeys(tuple(message.name) for message in messages)]
    there = tuple(dict.fromkeys(name for names in groups for name in names))
    places = zip(entry.joints, joint_indices(entry.joints, there), strict=True)
    if absent := [joint for joint, place in places if place is None]:
        return f"no joint {', '.join(absent)}: the topic has {', '.join(there) or 'no names'}"
    if all(None in joint_indices(entry.joints, names) for names in groups):
        said = "; ".join(", ".join(names) for names in groups)
        return f"no message has all joints once, they have {said}: write an entry for those of each"
    has = [q for q in QUANTITIES if any(len(getattr(message, q)) for message in messages)]
    if entry.quantity in has:
        return ""
    return f"no {entry.quantity}: the topic has {', '.join(has) or 'none'}"


def _has(message: object, field: str) -> bool:
    """Whether a message's type has a field; absent array elements may occur in later messages."""
    with suppress(ElementAbsentError):
        try:
            follow(message, parse_path(field))
        except (AttributeError, TypeError):
            return False
    return True

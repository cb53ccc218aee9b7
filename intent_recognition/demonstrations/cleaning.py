# SPDX-License-Identifier: Apache-2.0
"""Convert the messages of a bag to signals, without bad stamps and rejected tracker poses."""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.cluster.hierarchy import DisjointSet

from intent_recognition.array_types import Integers
from intent_recognition.bags import (
    JOINT_STATE,
    POSE,
    BagMessage,
    Columns,
    JointColumns,
    PoseColumns,
)
from intent_recognition.demonstrations.dofs import DofSpec, is_raw_pose
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import Content, pose_message, pose_numbers, values_of
from intent_recognition.signals import Signal
from intent_recognition.tracking import (
    NOT_FINITE,
    STAMP_NOT_INCREASING,
    ZERO_STAMP,
    IngestSettings,
    frame_name,
    ingest_poses,
)

MISSING_DOF = "missing_dof"
"""Reason for dropping a message that lacks a joint or field of an entry."""
TRANSFORMS = "tf2_msgs/msg/TFMessage"


@dataclass(frozen=True)
class TopicSamples:
    """The T accepted messages of one topic."""

    stamps_ns: Integers  # int64 (T,), strictly increasing for each publisher
    log_times_ns: Integers  # int64 (T,)
    content: Content  # all recorded messages; accepted raw poses are in the world frame
    rows: Integers  # indices of the accepted messages in `content`, int64 (T,)
    rejected: Mapping[str, int]  # number of rejected messages, by reason
    # sorted names of the frames of the content: for raw poses the world frame or the frame used as
    # the world, for other messages the frames that their headers name
    frames: tuple[str, ...] = ()


def clean_topic(
    topic: str,
    type_name: str,
    messages: Sequence[BagMessage],
    extrinsics: Mapping[str, tuple] | None = None,
) -> TopicSamples:
    """Drop messages as a node would: bad stamps, and raw poses that `ingest_pose` rejects.

    Raw poses are transformed to the world frame. Without `extrinsics`, the frame of the recording
    is used as the world: `world` if any message names it, else the frame named most often.
    """
    decoded: list[Any] = [message.message for message in messages]
    stamps_ns = np.array([message.stamp_ns for message in messages], np.int64)
    log_times_ns = np.array([message.log_time_ns for message in messages], np.int64)
    if is_raw_pose(topic, type_name):
        cleaned = clean_columns(topic, _pose_columns(stamps_ns, log_times_ns, decoded), extrinsics)
        poses: Any = cleaned.content
        for row in cleaned.rows:
            pose = poses.positions[row], poses.orientations[row]
            decoded[row] = pose_message(decoded[row].header, *pose)
        return replace(cleaned, content=decoded)
    rows, rejected = _increasing_of_each(stamps_ns, publishers_of(type_name, decoded))
    frames = frame_names(getattr(getattr(m, "header", None), "frame_id", "") for m in decoded)
    return TopicSamples(stamps_ns[rows], log_times_ns[rows], decoded, rows, rejected, frames)


def clean_columns(
    topic: str, columns: Columns, extrinsics: Mapping[str, tuple] | None = None
) -> TopicSamples:
    """Like `clean_topic`, for messages given as columns."""
    stamps_ns = columns.stamps_ns
    frames = frame_names(columns.frame_ids) if isinstance(columns, PoseColumns) else ()
    if isinstance(columns, PoseColumns) and is_raw_pose(topic, POSE):
        settings = _settings(columns, extrinsics)
        frames = frame_names([settings.world_frame])
        ordered, (kept, left_out) = np.zeros_like(stamps_ns), _increasing(stamps_ns)
        ordered[kept] = stamps_ns[kept]  # `ingest_poses` skips zero stamps
        columns, rows, rejected = ingest_poses(settings, replace(columns, stamps_ns=ordered))
        columns, rejected[ZERO_STAMP] = replace(columns, stamps_ns=stamps_ns), 0
        rejected = rejected + left_out
    else:
        rows, rejected = _increasing_of_each(stamps_ns, publishers_in(columns))
    return TopicSamples(
        stamps_ns[rows], columns.log_times_ns[rows], columns, rows, rejected, frames
    )


def signal_of(
    entry: DofEntry, samples: TopicSamples, start_ns: int | None = None, end_ns: int | None = None
) -> tuple[Signal, Counter[str]]:
    """Signal of the entry's DOFs between two stamps, and counts of dropped messages by reason.

    A message is dropped if it lacks a joint or field, or has NaN or infinity in a DOF.
    """
    inside = np.ones(samples.stamps_ns.size, bool)
    if start_ns is not None:
        inside &= samples.stamps_ns >= start_ns
    if end_ns is not None:
        inside &= samples.stamps_ns <= end_ns
    stamps_ns = samples.stamps_ns[inside]
    values, found = values_of(entry, samples.content, samples.rows[inside])
    finite = found & np.all(np.isfinite(values), axis=1)
    counts = {MISSING_DOF: int(np.sum(~found)), NOT_FINITE: int(np.sum(found & ~finite))}
    rows, late = _increasing(stamps_ns[finite])
    signal = Signal(entry.names, stamps_ns[finite][rows], values[finite][rows], entry.unit)
    return signal, _counter(counts | late)


def context_of(
    spec: DofSpec, samples: Mapping[str, TopicSamples], start_ns: int, end_ns: int
) -> tuple[Signal, ...]:
    """Signals of the scene for a movement, from the last sample before its start to its end."""
    signals = []
    for entry in spec.context:
        signal, _ = signal_of(entry, samples[entry.stream], end_ns=end_ns)
        before = signal.stamps_ns[signal.stamps_ns <= start_ns]
        signals.append(signal.between(int(before[-1]) if len(before) else start_ns, end_ns))
    return tuple(signals)


def signals_of(
    spec: DofSpec,
    samples: Mapping[str, TopicSamples],
    start_ns: int | None = None,
    end_ns: int | None = None,
    *,
    count_topics: bool = True,
) -> tuple[tuple[Signal, ...], tuple[Signal, ...], Counter[str]]:
    """Observed and controlled signals of a bag or a part of it, and counts of dropped messages.

    With `count_topics` the counts include bad stamps and outliers anywhere in the bag. In a session
    only the first demonstration includes these, so that they are counted once.
    """
    rejected: Counter[str] = Counter()
    for stream in spec.streams if count_topics else ():
        rejected.update(samples[stream].rejected)
    sides = []
    for entries in (spec.observed, spec.controlled):
        signals = []
        for entry in entries:
            signal, dropped = signal_of(entry, samples[entry.stream], start_ns, end_ns)
            signals.append(signal)
            rejected.update(dropped)
        sides.append(tuple(signals))
    return sides[0], sides[1], rejected


def _pose_columns(
    stamps_ns: Integers, log_times_ns: Integers, messages: Sequence[Any]
) -> PoseColumns:
    frames: dict[str, int] = {}
    indices = [frames.setdefault(m.header.frame_id, len(frames)) for m in messages]
    poses = np.array([pose_numbers(m) for m in messages], np.float64).reshape(-1, 7)
    return PoseColumns(
        log_times_ns,
        stamps_ns,
        tuple(frames),
        np.array(indices, np.int64),
        poses[:, :3],
        poses[:, 3:],
    )


def _settings(columns: PoseColumns, extrinsics: Mapping[str, tuple] | None) -> IngestSettings:
    if extrinsics is not None:
        return IngestSettings(extrinsics=extrinsics)
    named, first, counts = np.unique(columns.frames, return_index=True, return_counts=True)
    frames: Counter[str] = Counter()
    for k in np.argsort(first):
        frames[columns.frame_ids[named[k]]] += int(counts[k])
    default = IngestSettings().world_frame
    if not frames or default in {frame.removeprefix("/") for frame in frames}:
        return IngestSettings()
    return IngestSettings(world_frame=frames.most_common(1)[0][0])


def frame_names(frame_ids: Iterable[object]) -> tuple[str, ...]:
    """Sorted distinct frame names, without empty ones."""
    return tuple(sorted({frame_name(f) for f in frame_ids if isinstance(f, str)} - {""}))


def publishers_of(type_name: str, messages: Sequence[Any]) -> Integers:
    """Index of the publisher of each message (T,): messages with a common joint or tf frame are
    assumed to come from one publisher.
    """
    if type_name == JOINT_STATE:
        return _publishers([message.name for message in messages])
    if type_name == TRANSFORMS:
        return _publishers([[t.child_frame_id for t in m.transforms] for m in messages])
    return np.zeros(len(messages), np.int64)


def publishers_in(columns: Columns) -> Integers:
    """Like `publishers_of`, for messages given as columns."""
    publishers = np.zeros(columns.stamps_ns.size, np.int64)
    if isinstance(columns, JointColumns):
        of_parts = _publishers([part.names for part in columns.parts])
        for part, publisher in zip(columns.parts, of_parts, strict=True):
            publishers[part.rows] = publisher
    return publishers


def _publishers(names: Sequence[Sequence[str]]) -> Integers:
    joined = DisjointSet()
    for one in dict.fromkeys(map(tuple, names)):
        for name in one:
            joined.add(name)
            joined.merge(one[0], name)
    roots = [joined[one[0]] if len(one) else "" for one in names]
    numbers = {name: k for k, name in enumerate(dict.fromkeys(roots))}
    return np.array([numbers[name] for name in roots], np.int64)


def _increasing_of_each(stamps_ns: Integers, publishers: Integers) -> tuple[Integers, Counter[str]]:
    """Apply `_increasing` to each publisher's messages; the rows are sorted."""
    rows, rejected = [np.empty(0, np.int64)], Counter[str]()
    for publisher in np.unique(publishers):
        own = np.flatnonzero(publishers == publisher)
        kept, counts = _increasing(stamps_ns[own])
        rows.append(own[kept])
        rejected += counts
    return np.sort(np.concatenate(rows)), rejected


def _increasing(stamps_ns: Integers) -> tuple[Integers, Counter[str]]:
    """Rows whose stamp is positive and later than all before, and counts of the rejected rows.

    If a longest increasing subsequence is longer, as after one stamp in the future, it is taken.
    """
    positive = np.flatnonzero(stamps_ns > 0)
    stamps = stamps_ns[positive]
    latest_ns = np.maximum.accumulate(stamps)
    accepted = np.flatnonzero(np.diff(latest_ns, prepend=0) > 0)
    if accepted.size < stamps.size and accepted.size < (most := _most_in_order(stamps)).size:
        accepted = most
    return positive[accepted], _counter(
        {
            ZERO_STAMP: stamps_ns.size - stamps.size,
            STAMP_NOT_INCREASING: stamps.size - accepted.size,
        }
    )


def _most_in_order(stamps_ns: Integers) -> Integers:
    """Rows of a longest increasing subsequence (Fredman 1975)."""
    ends: list[int] = []  # earliest last stamp of a subsequence of each length
    rows: list[int] = []  # row of that stamp
    before = np.full(stamps_ns.size, -1)
    for row, stamp_ns in enumerate(stamps_ns.tolist()):
        length = bisect_left(ends, stamp_ns)
        before[row] = rows[length - 1] if length else -1
        ends[length : length + 1], rows[length : length + 1] = [stamp_ns], [row]
    found, row = [], rows[-1] if rows else -1
    while row >= 0:
        found.append(row)
        row = int(before[row])
    return np.array(found[::-1], dtype=np.int64)


def _counter(counts: Mapping[str, int]) -> Counter[str]:
    """Counter of the counts above zero."""
    return Counter({reason: count for reason, count in counts.items() if count})

# SPDX-License-Identifier: Apache-2.0
"""From the messages of a bag to signals: stamps checked, poses through the tracker's ingest."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from intent_recognition.errors import MessageError
from intent_recognition.promp.signals import Signal
from intent_recognition.storage.bag_reader import BagMessage
from intent_recognition.storage.dofs import DofEntry, DofSpec, extract, relative_topic
from intent_recognition.tracking.ingest import (
    NOT_FINITE,
    STAMP_NOT_INCREASING,
    ZERO_STAMP,
    IngestSettings,
    IngestState,
    TrackedPose,
    ingest_pose,
)

POSE = "geometry_msgs/msg/PoseStamped"
RAW_POSE_TOPIC = re.compile(r"(.*/)?mocap/[^/]+/pose")
MISSING_DOF = "missing_dof"


@dataclass(frozen=True)
class TopicSamples:
    """Accepted messages of one topic: stamps in ns and in log time, decoded and checked."""

    stamps_ns: tuple[int, ...]
    log_times_ns: tuple[int, ...]
    messages: tuple[object, ...]
    rejected: Mapping[str, int]


def is_raw_pose(topic: str, type_name: str) -> bool:
    """Whether messages of this topic come straight from a tracker and need its checks."""
    return type_name == POSE and RAW_POSE_TOPIC.fullmatch(relative_topic(topic)) is not None


def clean_topic(
    topic: str,
    type_name: str,
    messages: Sequence[BagMessage],
    extrinsics: Mapping[str, tuple] | None = None,
) -> TopicSamples:
    """Drop what a node would drop: bad stamps, and for raw poses all that ingest rejects.

    Poses come out in the world frame. Without `extrinsics` the frame of the recording counts as
    the world: `world` where any message names it, else the frame most messages name.
    """
    if is_raw_pose(topic, type_name):
        return _clean_poses(messages, extrinsics)
    rejected: Counter[str] = Counter()
    accepted: list[BagMessage] = []
    last_ns = 0
    for message in messages:
        if message.stamp_ns <= 0:
            rejected[ZERO_STAMP] += 1
        elif message.stamp_ns <= last_ns:
            rejected[STAMP_NOT_INCREASING] += 1
        else:
            accepted.append(message)
            last_ns = message.stamp_ns
    return _samples(accepted, [m.message for m in accepted], rejected)


def signal_of(
    entry: DofEntry, samples: TopicSamples, start_ns: int | None = None, end_ns: int | None = None
) -> tuple[Signal, Counter[str]]:
    """Values of the entry's DOFs between two stamps, and what was dropped on the way.

    A message that lacks one of the joints, or holds NaN or infinity in one of the DOFs, is
    dropped and counted.
    """
    rejected: Counter[str] = Counter()
    stamps, rows = [], []
    for stamp_ns, message in zip(samples.stamps_ns, samples.messages, strict=True):
        if (start_ns is not None and stamp_ns < start_ns) or (
            end_ns is not None and stamp_ns > end_ns
        ):
            continue
        try:
            values = extract(entry, message)
        except MessageError:
            rejected[MISSING_DOF] += 1
            continue
        if np.all(np.isfinite(values)):
            stamps.append(stamp_ns)
            rows.append(values)
        else:
            rejected[NOT_FINITE] += 1
    values = np.array(rows).reshape(len(rows), len(entry.names))
    return Signal(entry.names, np.array(stamps, np.int64), values, entry.unit), rejected


def signals_of(
    spec: DofSpec,
    samples: Mapping[str, TopicSamples],
    start_ns: int | None = None,
    end_ns: int | None = None,
    *,
    count_topics: bool = True,
) -> tuple[tuple[Signal, ...], tuple[Signal, ...], Counter[str]]:
    """Observed and controlled signals of a bag or of a part of it, and all counts by reason.

    `count_topics` includes what was dropped anywhere in the bag for its stamp or as an outlier;
    of a session's demonstrations the first reports it, so that it is counted once.
    """
    rejected: Counter[str] = Counter()
    for topic in spec.topics if count_topics else ():
        rejected.update(samples[topic].rejected)
    sides = []
    for entries in (spec.observed, spec.controlled):
        signals = []
        for entry in entries:
            signal, dropped = signal_of(entry, samples[entry.topic], start_ns, end_ns)
            signals.append(signal)
            rejected.update(dropped)
        sides.append(tuple(signals))
    return sides[0], sides[1], rejected


def _clean_poses(
    messages: Sequence[BagMessage], extrinsics: Mapping[str, tuple] | None
) -> TopicSamples:
    settings = _settings(messages, extrinsics)
    state = IngestState.initial()
    rejected: Counter[str] = Counter()
    accepted, poses = [], []
    for item in messages:
        raw = item.message
        position, orientation = raw.pose.position, raw.pose.orientation
        state, result = ingest_pose(
            settings,
            state,
            item.stamp_ns,
            np.array([position.x, position.y, position.z]),
            np.array([orientation.x, orientation.y, orientation.z, orientation.w]),
            raw.header.frame_id,
        )
        if isinstance(result, TrackedPose):
            accepted.append(item)
            poses.append(pose_message(raw.header, result))
        else:
            rejected[result.reason] += 1
    # After a clock that was set back the track goes on; a signal cannot: keep the longest part.
    return _increasing(accepted, poses, rejected)


def _increasing(accepted: list[BagMessage], poses: list, rejected: Counter) -> TopicSamples:
    stamps = np.array([item.stamp_ns for item in accepted], dtype=np.int64)
    breaks = np.flatnonzero(np.diff(stamps) <= 0) + 1
    if breaks.size:
        edges = [0, *breaks.tolist(), len(accepted)]
        longest = int(np.argmax(np.diff(edges)))
        first, last = edges[longest], edges[longest + 1]
        rejected[STAMP_NOT_INCREASING] += len(accepted) - (last - first)
        accepted, poses = accepted[first:last], poses[first:last]
    return _samples(accepted, poses, rejected)


def _settings(
    messages: Sequence[BagMessage], extrinsics: Mapping[str, tuple] | None
) -> IngestSettings:
    if extrinsics is not None:
        return IngestSettings(extrinsics=extrinsics)
    frames = Counter(item.message.header.frame_id for item in messages)
    default = IngestSettings().world_frame
    if not frames or default in {frame.removeprefix("/") for frame in frames}:
        return IngestSettings()
    return IngestSettings(world_frame=frames.most_common(1)[0][0])


def pose_message(header: object, pose: TrackedPose) -> SimpleNamespace:
    """The world-frame pose with the attributes of a PoseStamped, for the field paths."""
    x, y, z = pose.position
    qx, qy, qz, qw = pose.orientation
    return SimpleNamespace(
        header=header,
        pose=SimpleNamespace(
            position=SimpleNamespace(x=x, y=y, z=z),
            orientation=SimpleNamespace(x=qx, y=qy, z=qz, w=qw),
        ),
    )


def _samples(accepted: list[BagMessage], messages: list, rejected: Counter) -> TopicSamples:
    return TopicSamples(
        tuple(item.stamp_ns for item in accepted),
        tuple(item.log_time_ns for item in accepted),
        tuple(messages),
        dict(rejected),
    )

# SPDX-License-Identifier: Apache-2.0
"""Summarise a recording: its topics, rates, gaps, demonstrations and damage."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Integers
from intent_recognition.bags import (
    JOINT_STATE,
    POSE,
    BagMessage,
    BagReader,
    Columns,
    Damage,
    JointColumns,
    TopicInfo,
    decode,
)
from intent_recognition.demonstrations.cleaning import (
    clean_columns,
    clean_topic,
    publishers_in,
    publishers_of,
)
from intent_recognition.demonstrations.dofs import DofSpec, is_raw_pose, relative_topic
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.reading import iter_demonstrations
from intent_recognition.demonstrations.sessions import (
    SessionPart,
    clock_shift_ns,
    find_marker_topic,
    split_session,
    task_of,
)
from intent_recognition.errors import BagError, MessageError
from intent_recognition.signals import (
    POSITION_FIELDS,
    RecordingSummary,
    Rejection,
    summarise,
)

EMPTY = "it holds no messages: nothing was published while it was recorded"


@dataclass(frozen=True)
class TopicSummary:
    """Summary of the readable messages of one topic."""

    name: str
    type: str
    count: int
    # inverse of the median step between the stamps of a publisher, 0 with fewer than two messages
    rate_hz: float = 0.0
    # (log time before the gap [ns], length [s]) of steps over three times the publisher's median
    gaps: tuple[tuple[int, float], ...] = ()
    longest_gap_s: float = 0.0  # longest step, 0 with fewer than two messages
    # messages that a node would drop, by reason: bad stamps and, for raw poses, outliers
    rejected: Mapping[str, int] = field(default_factory=dict)
    not_finite: int = 0  # number of messages with NaN or infinity
    undecodable: int = 0  # number of messages that do not fit their type


@dataclass(frozen=True)
class BagSummary:
    """Summary of a recording, from the log time of its first readable message to the last."""

    path: str
    task: str | None
    custom_data: Mapping[str, str]
    start_ns: int
    end_ns: int
    topics: tuple[TopicSummary, ...]  # in recorded order
    demonstrations: tuple[SessionPart, ...] = ()  # those of a session bag, in order
    # demonstrations of a session without an end or with an invalid label
    unfinished: tuple[Rejection, ...] = ()
    damage: tuple[Damage, ...] = ()
    notes: tuple[str, ...] = ()  # other oddities, as sentences

    @property
    def duration_s(self) -> float:
        """Length of the recording in seconds."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def message_count(self) -> int:
        """Number of messages of all topics."""
        return sum(topic.count for topic in self.topics)


def inspect_bag(path: str | Path) -> BagSummary:
    """Summarise a bag; damage is reported in the summary, not raised.

    Raises:
        BagError: no file of the bag can be read.
    """
    reader = BagReader(path, tolerant=True)
    topics: list[TopicSummary] = []
    markers: list[BagMessage] = []
    times_ns: list[int] = []
    marker = find_marker_topic(reader)
    quick = [info.name for info in reader.topics.values() if info.type in (POSE, JOINT_STATE)]
    columns = reader.columns(quick)
    for info in reader.topics.values():
        if (found := columns.get(info.name.lstrip("/"))) is not None:
            stream = _of_columns(info, found)
        else:
            messages, stream = _decoded(reader, info)
            if info.name.lstrip("/") == marker:
                markers = messages
        topics.append(_summarise(info, stream))
        if stream.log_times_ns.size:
            times_ns += [int(stream.log_times_ns.min()), int(stream.log_times_ns.max())]
    if not reader.damage:
        times_ns = [reader.start_ns, reader.end_ns]
    elif not times_ns:  # the headers of damaged chunks still have their start times
        times_ns = [reader.start_ns]
    parts = list(split_session(markers, {}, str(path))) if markers else []
    is_empty = reader.is_finished and not (reader.damage or any(topic.count for topic in topics))
    return BagSummary(
        path=str(path),
        task=task_of(reader),
        custom_data=reader.custom_data,
        start_ns=min(times_ns),
        end_ns=max(times_ns),
        topics=tuple(topics),
        demonstrations=tuple(p for p in parts if isinstance(p, SessionPart)),
        unfinished=tuple(p for p in parts if isinstance(p, Rejection)),
        damage=tuple(reader.damage),
        notes=(*reader.notes, *((EMPTY,) if is_empty else ())),
    )


def inspect_streams(
    path: str | Path, dofs: DofSpec | None = None
) -> list[Rejection | RecordingSummary]:
    """Summaries of a bag's demonstrations, for `stream_doubts`, or their rejections.

    Without DOFs, the positions of all tracked bodies and joints are used.

    Raises:
        BagError: no file of the bag can be read.
    """
    dofs = _all_dofs(BagReader(path, tolerant=True)) if dofs is None else dofs
    if dofs is None:
        return []
    return [
        found if isinstance(found, Rejection) else summarise(found)
        for found in iter_demonstrations(path, dofs)
    ]


def _all_dofs(reader: BagReader) -> DofSpec | None:
    """DOFs of all tracked bodies and joints. Without joints, the first body is the observed one."""
    bodies, arms = [], []
    for info in reader.topics.values():
        topic = relative_topic(info.name)
        if is_raw_pose(topic, info.type):
            bodies.append(DofEntry(topic, info.type, fields=POSITION_FIELDS, unit="m"))
        elif info.type == JOINT_STATE and topic.split("/")[-1] == "joint_states":
            columns = reader.columns([topic])[topic]
            named = (
                [part.names for part in columns.parts]
                if isinstance(columns, JointColumns)
                else [tuple(m.message.name) for m in _decoded(reader, info)[0]]
            )
            if names := max(named, key=len, default=()):
                arms.append(DofEntry(topic, info.type, joints=names, unit="rad"))
    if not arms:
        bodies, arms = bodies[:1], bodies[1:]
    return DofSpec(tuple(bodies), tuple(arms)) if bodies and arms else None


class _Stream(NamedTuple):
    """Times and faults of the T decodable messages of a topic."""

    stamps_ns: Integers  # (T,)
    log_times_ns: Integers  # (T,)
    publishers: Integers  # (T,)
    rejected: Mapping[str, int]
    not_finite: int
    undecodable: int = 0


def _of_columns(info: TopicInfo, columns: Columns) -> _Stream:
    if isinstance(columns, JointColumns):
        numbers = [np.hstack(part[3:]) for part in columns.parts]
    else:
        numbers = [np.hstack([columns.positions, columns.orientations])]
    not_finite = sum(int(np.sum(~np.isfinite(rows).all(axis=1))) for rows in numbers)
    rejected = clean_columns(info.name, columns).rejected
    times_ns = columns.stamps_ns, columns.log_times_ns
    return _Stream(*times_ns, publishers_in(columns), rejected, not_finite)


def _decoded(reader: BagReader, info: TopicInfo) -> tuple[list[BagMessage], _Stream]:
    """Messages of a topic, reduced to their headers if large, and their times and faults."""
    messages, not_finite, undecodable = [], 0, 0
    try:
        decoder = reader.decoder(info.name, info.type)
    except BagError:
        empty = np.zeros(0, np.int64)
        return [], _Stream(empty, empty, empty, {}, 0, info.message_count)
    for raw in reader.raw_messages([info.name]):
        try:
            found = decode(raw, decoder)
        except MessageError:
            undecodable += 1
            continue
        not_finite += not _is_finite(found.message)
        header = getattr(found.message, "header", None)
        if len(raw.data) > 2**14 and header is not None and info.type not in (POSE, JOINT_STATE):
            found = replace(found, message=SimpleNamespace(header=header))
        messages.append(found)
    rejected: Mapping[str, int] = {}
    if messages and hasattr(messages[0].message, "header"):
        rejected = clean_topic(info.name, info.type, messages).rejected
    stamps_ns = np.array([m.stamp_ns for m in messages], dtype=np.int64)
    log_times_ns = np.array([m.log_time_ns for m in messages], dtype=np.int64)
    publishers = publishers_of(info.type, [m.message for m in messages])
    stream = _Stream(stamps_ns, log_times_ns, publishers, rejected, not_finite, undecodable)
    return messages, stream


def _summarise(info: TopicInfo, stream: _Stream) -> TopicSummary:
    stamps, log_times, publishers, rejected, not_finite, undecodable = stream
    logged = stamps + clock_shift_ns((log_times - stamps)[stamps > 0])
    own = [np.sort(logged[(stamps > 0) & (publishers == p)]) for p in np.unique(publishers)]
    before = np.concatenate([np.empty(0, np.int64), *(times_ns[:-1] for times_ns in own)])
    steps = [np.diff(times_ns) * 1e-9 for times_ns in own if times_ns.size > 1]
    usual_s = np.concatenate([np.empty(0), *(np.full(s.size, np.median(s)) for s in steps)])
    steps_s = np.concatenate([np.empty(0), *steps])
    median_s = float(np.median(steps_s)) if steps_s.size else 0.0
    at = np.flatnonzero((usual_s > 0) & (steps_s > 3.0 * usual_s))
    return TopicSummary(
        name=info.name,
        type=info.type,
        count=stamps.size + undecodable,
        rate_hz=1.0 / median_s if median_s > 0 else 0.0,
        gaps=tuple((int(before[i]), float(steps_s[i])) for i in at),
        longest_gap_s=float(steps_s.max(initial=0.0)),
        rejected=dict(rejected),
        not_finite=not_finite,
        undecodable=undecodable,
    )


def _is_finite(value: object) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, str | bytes | int) or value is None:
        return True
    if isinstance(value, list | tuple):
        if value and isinstance(value[0], float):  # then all elements are floats
            return all(map(math.isfinite, value))
        return all(_is_finite(item) for item in value)
    names = getattr(type(value), "__slots__", None) or getattr(value, "__dict__", None)
    if names is not None:
        return all(_is_finite(getattr(value, name)) for name in names)
    array = np.asarray(value)
    return array.dtype.kind != "f" or bool(np.all(np.isfinite(array)))

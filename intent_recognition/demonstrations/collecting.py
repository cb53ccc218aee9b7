# SPDX-License-Identifier: Apache-2.0
"""Collect the samples of all topics of one recording, up to the first damage."""

from collections.abc import Mapping
from dataclasses import replace

from intent_recognition.bags import RECOVER, BagMessage, BagReader
from intent_recognition.demonstrations.cleaning import (
    TopicSamples,
    clean_columns,
    clean_topic,
    frame_names,
)
from intent_recognition.demonstrations.dofs import DofSpec, relative_topic
from intent_recognition.demonstrations.fields import has_columns, stamp_of
from intent_recognition.demonstrations.paths import (
    STAMPED_ELEMENTS,
    body_of,
    element_headers,
    element_names,
)
from intent_recognition.errors import BagError, MessageError, first_of
from intent_recognition.signals import Rejection


def missing_topic(reader: BagReader, dofs: DofSpec) -> Rejection | None:
    """Rejection of a recording that lacks a topic of the DOFs; None if all have messages."""
    recorded = {relative_topic(name): info for name, info in reader.topics.items()}
    lost = "" if reader.is_finished else "unfinished: the recording was not closed; "
    if reader.damage:
        lost = f"damaged: {reader.damage[0].reason}; "
    for topic, kind in dofs.topics.items():
        if topic not in recorded:
            has = ", ".join(sorted(recorded)) or "nothing"
            reason = f"{lost}missing topic: the bag has {has}"
        elif recorded[topic].type != kind:
            reason = f"wrong schema: expected {kind}, recorded as {recorded[topic].type or 'none'}"
        elif recorded[topic].message_count == 0:
            reason = f"{lost}empty: the bag has no message on this topic"
        else:
            continue
        return Rejection(str(reader.path), f"/{topic}", 0, reason, RECOVER if lost else "")
    return None


def collect(
    reader: BagReader, dofs: DofSpec, marker: str | None, extrinsics: Mapping[str, tuple] | None
) -> tuple[dict[str, TopicSamples], list[BagMessage], Rejection | None]:
    """Samples by stream and markers before the first damage, and the rejection for the damage."""
    marker_topics = [marker] if marker else []
    try:
        samples = _columns(reader, dofs, extrinsics)
        if samples is not None:
            return samples, list(reader.messages(marker_topics)) if marker else [], None
    except BagError:  # read single messages, to find how far the recording can be read
        pass
    messages: dict[str, list[BagMessage]] = {t: [] for t in [*dofs.topics, *marker_topics]}
    last_ns, damage = 0, None
    try:
        for message in reader.messages(messages):
            messages[relative_topic(message.topic)].append(message)
            last_ns = message.log_time_ns
    except MessageError as error:
        damage = Rejection.of(str(reader.path), error, "wrong schema", last_ns)
    except BagError as error:
        damage = Rejection.of(str(reader.path), error, "damaged", last_ns)
    samples = {}
    for stream, entry in dofs.streams.items():
        recorded = messages[entry.topic]
        stamps = (stamp_of(entry, m.message, m.log_time_ns) for m in recorded)
        both = zip(recorded, stamps, strict=True)
        about = [replace(m, stamp_ns=ns) for m, ns in both if ns is not None]
        if recorded and not about and damage is None:
            has = {name for m in recorded for name in element_names(m.message, entry.fields)} - {""}
            there = ", ".join(sorted(has)) or "none that was seen"
            reason = f"no {', '.join(entry.fields)}: the topic has {there}"
            damage = Rejection(str(reader.path), f"/{entry.topic}", 0, reason)
        bodies = {body_of(m.message) for m in about if not entry.joints} - {""}
        if 1 < len(bodies) < len(about):  # a name of its own in each only counts messages
            reason = f"several bodies on one topic: {first_of(sorted(bodies))}"
            cure = "Publish each on a topic of its own, or read them from tf."
            damage = damage or Rejection(str(reader.path), f"/{entry.topic}", 0, reason, cure)
            about = []
        samples[stream] = clean_topic(entry.topic, entry.type, about, extrinsics)
        if entry.type in STAMPED_ELEMENTS:
            headers = [h for m in about for h in element_headers(m.message, entry.fields)]
            frames = frame_names(header.frame_id for header in headers)
            samples[stream] = replace(samples[stream], frames=frames)
    return samples, messages[marker] if marker else [], damage


def _columns(
    reader: BagReader, dofs: DofSpec, extrinsics: Mapping[str, tuple] | None
) -> dict[str, TopicSamples] | None:
    """Samples of all topics, read as columns; None if a topic cannot be read as columns."""
    if not all(map(has_columns, dofs.recorded)):
        return None
    columns = reader.columns(dofs.topics)
    if any(found is None for found in columns.values()):
        return None
    return {
        topic: clean_columns(topic, found, extrinsics)
        for topic, found in columns.items()
        if found is not None
    }

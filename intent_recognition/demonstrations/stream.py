# SPDX-License-Identifier: Apache-2.0
"""The observations in a recording, one after the other, as the running nodes would see them."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations.dofs import DofSpec, extract
from intent_recognition.demonstrations.measuring import ObservationReader, observation_readers
from intent_recognition.demonstrations.signals import MISSING_DOF, is_raw_pose, pose_message
from intent_recognition.errors import MessageError
from intent_recognition.signals import Observation
from intent_recognition.tracking import IngestSettings, IngestState, Rejected, ingest_pose

POSITION_FIELDS = ("pose.position.x", "pose.position.y", "pose.position.z")


class Sample(NamedTuple):
    """One measurement of either agent; groups count the signals of each agent for itself."""

    controlled: bool
    observation: Observation


def iter_observations(
    reader: BagReader,
    dofs: DofSpec,
    settings: IngestSettings | None = None,
    rejected: Counter[str] | None = None,
) -> Iterator[Observation]:
    """Observations of the human in the order they were recorded; see `iter_samples`."""
    for _, observation in iter_samples(reader, dofs, settings, rejected, controlled=False):
        yield observation


def iter_samples(
    reader: BagReader,
    dofs: DofSpec,
    settings: IngestSettings | None = None,
    rejected: Counter[str] | None = None,
    *,
    controlled: bool = True,
) -> Iterator[Sample]:
    """Measurements of both agents in the order they were recorded.

    Raw tracker poses pass through the same ingest as in the node `mocap_ingest`.

    Args:
        reader: the recording.
        dofs: which topics and fields to read.
        settings: of the ingest; the node's defaults when None.
        rejected: counts what is dropped, by reason.
        controlled: whether to read the controlled agent too.
    """
    settings = settings or IngestSettings()
    rejected = Counter() if rejected is None else rejected
    instruments = [(False, one) for one in observation_readers(dofs)]
    if controlled:
        instruments += [
            (True, ObservationReader(e, group)) for group, e in enumerate(dofs.controlled)
        ]
    by_topic: dict[str, list[tuple[bool, ObservationReader]]] = defaultdict(list)
    for found in instruments:
        by_topic[found[1].entry.topic].append(found)
    states: Mapping[str, IngestState] = defaultdict(IngestState.initial)
    for item in reader.messages(list(by_topic)):
        topic = item.topic.lstrip("/")
        stamp, message, covariance = item.stamp_ns, item.message, None
        if is_raw_pose(topic, by_topic[topic][0][1].entry.type):
            states[topic], result = ingest_pose(
                settings, states[topic], stamp, *_pose(message), message.header.frame_id
            )
            if isinstance(result, Rejected):
                rejected[result.reason] += 1
                continue
            message, covariance = pose_message(message.header, result), result.position_covariance
        for of_controlled, observation_reader in by_topic[topic]:
            try:
                if of_controlled:
                    values = extract(observation_reader.entry, message)
                    observation = Observation(stamp, observation_reader.group, values)
                else:
                    observation = observation_reader.observe(stamp, message, covariance)
            except MessageError:
                rejected[MISSING_DOF] += 1
                continue
            yield Sample(of_controlled, observation)


def _pose(message: object) -> tuple[np.ndarray, np.ndarray]:
    p, q = message.pose.position, message.pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])

# SPDX-License-Identifier: Apache-2.0
"""The observations in a recording, one after the other, as the running nodes would see them."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping

import numpy as np

from intent_recognition.errors import MessageError
from intent_recognition.promp.observations import Observation
from intent_recognition.storage.bag_reader import BagReader
from intent_recognition.storage.dofs import DofEntry, DofSpec, extract
from intent_recognition.storage.signals import MISSING_DOF, is_raw_pose, pose_message
from intent_recognition.tracking.ingest import IngestSettings, IngestState, Rejected, ingest_pose

POSITION_FIELDS = ("pose.position.x", "pose.position.y", "pose.position.z")


def pose_covariance(entry: DofEntry, position_covariance: np.ndarray) -> np.ndarray:
    """Measurement covariance of the entry's fields of a pose, (m, m); zero for others.

    Args:
        entry: fields of a PoseStamped.
        position_covariance: (3, 3) [m^2], world axes.
    """
    axes = [POSITION_FIELDS.index(f) if f in POSITION_FIELDS else -1 for f in entry.fields]
    rows = np.array(axes)
    known = (rows[:, None] >= 0) & (rows[None, :] >= 0)
    return np.where(known, position_covariance[np.ix_(rows, rows)], 0.0)


def iter_observations(
    reader: BagReader,
    dofs: DofSpec,
    settings: IngestSettings | None = None,
    rejected: Counter[str] | None = None,
) -> Iterator[Observation]:
    """Observations of the human in the order they were recorded.

    Raw tracker poses pass through the same ingest as in the node `mocap_ingest`.

    Args:
        reader: the recording.
        dofs: which topics and fields to read.
        settings: of the ingest; the node's defaults when None.
        rejected: counts what is dropped, by reason.
    """
    settings = settings or IngestSettings()
    rejected = Counter() if rejected is None else rejected
    groups: dict[str, list[int]] = defaultdict(list)
    for group, entry in enumerate(dofs.observed):
        groups[entry.topic].append(group)
    states: Mapping[str, IngestState] = defaultdict(IngestState.initial)
    for item in reader.messages(list(groups)):
        topic = item.topic.lstrip("/")
        stamp, message, covariance = item.stamp_ns, item.message, None
        if is_raw_pose(topic, dofs.observed[groups[topic][0]].type):
            states[topic], result = ingest_pose(
                settings, states[topic], stamp, *_pose(message), message.header.frame_id
            )
            if isinstance(result, Rejected):
                rejected[result.reason] += 1
                continue
            message, covariance = pose_message(message.header, result), result.position_covariance
        for group in groups[topic]:
            entry = dofs.observed[group]
            try:
                values = extract(entry, message)
            except MessageError:
                rejected[MISSING_DOF] += 1
                continue
            noise = None if covariance is None else pose_covariance(entry, covariance)
            yield Observation(stamp, group, values, noise)


def _pose(message: object) -> tuple[np.ndarray, np.ndarray]:
    p, q = message.pose.position, message.pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])

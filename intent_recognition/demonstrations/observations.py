# SPDX-License-Identifier: Apache-2.0
"""Read observations of the human from single messages and from whole recordings.

Nodes and `intent replay` both use `ObservationReader`, so that they get the same numbers.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from enum import Enum
from functools import partial
from math import isnan
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.bags import POSE, BagReader
from intent_recognition.demonstrations.cleaning import MISSING_DOF
from intent_recognition.demonstrations.dofs import DofSpec, is_raw_pose
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.fields import (
    dofs_of,
    extract,
    extract_present,
    pose_message,
    pose_numbers,
    reference_of,
    stamp_of,
)
from intent_recognition.demonstrations.paths import element_of
from intent_recognition.errors import MessageError
from intent_recognition.signals import (
    LARGEST_ANGLE_RAD,
    POSE_FIELDS,
    Observation,
    to_tangent_covariance,
)
from intent_recognition.tracking import (
    UNKNOWN_VARIANCE,
    IngestSettings,
    IngestState,
    Rejected,
    ingest_pose,
)

POSES = (POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/Odometry")
"""Message types whose values are measured together: a message with NaN in a DOF is refused."""
AXES = {
    f"{part}.{axis}": first + k
    for first, parts in ((0, ("position", "linear")), (3, ("angular",)))
    for part in parts
    for k, axis in enumerate("xyz")
}
"""Row of each coordinate in the 6 x 6 covariance of a pose or twist."""


class Source(Enum):
    """The agent or scene that a sample measures."""

    OBSERVED = "human"
    CONTROLLED = "robot"
    CONTEXT = "scene"


class Sample(NamedTuple):
    """One measurement."""

    source: Source
    observation: Observation  # its `group` is the index of the signal within that source


class ObservationReader:
    """Converts messages of one entry of the DOF file to observations of an observed signal.

    For velocities, `group` is the signal they belong to and `columns` are its DOFs.
    """

    def __init__(self, entry: DofEntry, group: int, columns: tuple[int, ...] | None = None):
        self.entry, self.group = entry, group
        self._columns = columns
        self._whole = columns is None and entry.type in POSES
        whole_numbers = entry.joints or entry.orientation
        self._values = partial(extract_present, entry) if whole_numbers else _fields(entry)
        self._matrix, self._axes = _place_of_covariance(entry)
        self._unknown = np.minimum.outer(self._axes, self._axes) < 0
        self._has_unknown = bool(self._unknown.any())
        self._grid = np.ix_(self._axes, self._axes)
        self.pose_columns = None
        if entry.fields and set(entry.fields) <= set(POSE_FIELDS):
            self.pose_columns = np.array([POSE_FIELDS.index(field) for field in entry.fields])

    def observe(self, stamp_ns: int, message: Any, covariance: Floats | None = None) -> Observation:
        """The observation in a message of rclpy or a bag; NaN marks values that were not measured.

        A given `covariance` of the pose (6, 6) replaces the message's own.

        Raises:
            MessageError: a field, or every joint, is missing.
        """
        values = self._values(message)
        return self._observation(stamp_ns, values, self._noise(message, covariance, values))

    def observe_pose(self, stamp_ns: int, pose: Floats, covariance: Floats | None) -> Observation:
        """Like `observe`, for a tracked pose (7,) and its covariance (6, 6).

        Raises:
            MessageError: the entry has fields outside the pose, so that `pose_columns` is None.
        """
        if self.pose_columns is None:
            expected = f"fields among {', '.join(POSE_FIELDS)}"
            cure = "A tracked pose has no others; correct the DOF file."
            raise MessageError.about(self.entry.topic, expected, ", ".join(self.entry.fields), cure)
        values = dofs_of(self.entry, pose[self.pose_columns])
        return self._observation(stamp_ns, values, self._noise(None, covariance, values))

    def _observation(self, stamp_ns: int, values: Floats, noise: Floats | None) -> Observation:
        derivative = self._columns is not None
        found = Observation(stamp_ns, self.group, values, noise, self._columns, derivative)
        in_part = not self._whole and isnan(np.add.reduce(values))
        return found.measured() or found if in_part else found

    def _noise(self, message: Any, covariance: Floats | None, values: Floats) -> Floats | None:
        """Covariance from the message, or else from the DOF file; None if neither has one."""
        if covariance is None and self._matrix is not None:
            covariance = self._matrix(message)
            covariance = None if covariance is None else np.reshape(covariance, (6, 6))
        noise = None if covariance is None else covariance[self._grid]
        if noise is not None and self._has_unknown:
            noise = np.where(self._unknown, 0.0, noise)
        if noise is not None and not noise.any():  # in ROS, all zeros mean unknown
            noise = None
        if self.entry.orientation:
            return self._turned(noise, values)
        if noise is None and self.entry.std is not None:
            noise = np.eye(len(self._axes)) * self.entry.std**2
        return noise

    def _turned(self, noise: Floats | None, values: Floats) -> Floats | None:
        """Convert an orientation's noise about the world axes to that of its rotation vector."""
        unknown = noise is not None and np.any(np.diagonal(noise) >= UNKNOWN_VARIANCE)
        if unknown or np.any(np.isnan(values)):
            largest = f"{np.degrees(LARGEST_ANGLE_RAD):.0f} degrees"
            expected = f"an orientation within {largest} of the reference"
            cure = "Nothing, if it is rare; else give the entry another reference."
            raise MessageError.about(self.entry.names[0], expected, "none", cure)
        if noise is None:
            return None
        return to_tangent_covariance(noise, values, reference_of(self.entry))


def observation_readers(dofs: DofSpec) -> list[ObservationReader]:
    """Readers of the observed agent: positions, then velocities."""
    readers = [ObservationReader(entry, group) for group, entry in enumerate(dofs.observed)]
    for entry in dofs.velocities:
        if found := dofs.signal_of(entry):
            readers.append(ObservationReader(entry, *found))
    return readers


def iter_observations(
    reader: BagReader,
    dofs: DofSpec,
    settings: IngestSettings | None = None,
    rejected: Counter[str] | None = None,
) -> Iterator[Observation]:
    """Observations of the human in recorded order; arguments as in `iter_samples`."""
    of_human = replace(dofs, controlled=(), context=())
    for _, observation in iter_samples(reader, of_human, settings, rejected):
        yield observation


def iter_samples(
    reader: BagReader,
    dofs: DofSpec,
    settings: IngestSettings | None = None,
    rejected: Counter[str] | None = None,
) -> Iterator[Sample]:
    """Measurements of both agents and of the scene in recorded order.

    Raw tracker poses are checked and transformed as in the node `mocap_ingest`. The default
    settings are the node's with the DOF file's extrinsics. `rejected` counts dropped messages.
    """
    settings = settings or IngestSettings(extrinsics=dofs.tracker_frames or {})
    rejected = Counter() if rejected is None else rejected
    by_topic: dict[str, list[tuple[Source, ObservationReader]]] = defaultdict(list)
    for one in observation_readers(dofs):
        by_topic[one.entry.topic].append((Source.OBSERVED, one))
    for source, entries in ((Source.CONTROLLED, dofs.controlled), (Source.CONTEXT, dofs.context)):
        for group, entry in enumerate(entries):
            by_topic[entry.topic].append((source, ObservationReader(entry, group)))
    states: dict[str, IngestState] = defaultdict(IngestState)
    for item in reader.messages(list(by_topic)):
        topic = item.topic.lstrip("/")
        stamp, message = item.stamp_ns, item.message
        covariance = None
        if is_raw_pose(topic, by_topic[topic][0][1].entry.type):
            pose, frame_id = np.array(pose_numbers(message)), message.header.frame_id
            states[topic], result = ingest_pose(
                settings, states[topic], stamp, pose[:3], pose[3:], frame_id
            )
            if isinstance(result, Rejected):
                rejected[result.reason] += 1
                continue
            message = pose_message(message.header, result.position, result.orientation)
            measured = result.orientation_measured
            turn = settings.orientation_std_rad**2 if measured else UNKNOWN_VARIANCE
            covariance = np.diag([0.0, 0.0, 0.0, turn, turn, turn])
            covariance[:3, :3] = result.position_covariance
        for source, observation_reader in by_topic[topic]:
            measured_ns = stamp_of(observation_reader.entry, message, item.log_time_ns)
            if measured_ns is None:
                continue
            try:
                if source is Source.CONTROLLED:
                    values = extract(observation_reader.entry, message)
                    observation = Observation(measured_ns, observation_reader.group, values)
                else:
                    observation = observation_reader.observe(measured_ns, message, covariance)
            except MessageError:
                rejected[MISSING_DOF] += 1
                continue
            yield Sample(source, observation)


def _fields(entry: DofEntry) -> Callable[[Any], Floats]:
    if any(map(element_of, entry.fields)):
        return partial(extract_present, entry)
    read, single = attrgetter(*entry.fields), len(entry.fields) == 1

    def values(message: Any) -> Floats:
        try:
            found = read(message)
            return np.array([found] if single else found, dtype=np.float64)
        except (AttributeError, TypeError, ValueError):
            return extract(entry, message)  # raises an error with the reason

    return values


def _place_of_covariance(entry: DofEntry) -> tuple[Callable[[Any], Any] | None, Floats]:
    """Getter of a message's 6 x 6 covariance, and each DOF's row in it (d,), -1 for none."""
    count = len(entry.names)
    if entry.orientation and not any(map(element_of, entry.fields)):
        stem = ".".join(entry.fields[0].split(".")[:-3])
        return _matrix_at(".".join(filter(None, [stem, "covariance"]))), np.array([3, 4, 5])
    axes, holders = np.full(count, -1), set[str]()
    if any(map(element_of, entry.fields)):  # array elements have no covariance
        return None, axes
    for k, field in enumerate(entry.fields):
        parts = field.split(".")
        axis = AXES.get(".".join(parts[-2:]), -1)
        if axis >= 0:
            axes[k] = axis
            holders.add(".".join([*parts[:-3], "covariance"]))
    if len(holders) != 1:
        return None, axes
    return _matrix_at(*holders), axes


def _matrix_at(holder: str) -> Callable[[Any], Any]:
    """Getter of a 6 x 6 matrix, which returns None if a message has none there."""
    read = attrgetter(holder)

    def matrix(message: Any) -> Any:
        try:
            found = read(message)
        except AttributeError:
            return None
        return found if np.size(found) == 36 else None

    return matrix

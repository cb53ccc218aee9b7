# SPDX-License-Identifier: Apache-2.0
"""From a message to an observation: whatever of it was measured, with the sender's covariance.

The running node and `intent replay` use these same functions, so that their numbers are equal.
"""

from collections.abc import Callable
from functools import partial
from math import isnan
from operator import attrgetter

import numpy as np

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec, extract
from intent_recognition.demonstrations.velocities import place_of
from intent_recognition.errors import MessageError, describe
from intent_recognition.signals import Observation

POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "nav_msgs/msg/Odometry",
)
"""A position is measured as a whole or not at all: one with NaN in it is refused."""
POSE_FIELDS = tuple(
    f"pose.{part}.{axis}"
    for part, axes in (("position", "xyz"), ("orientation", "xyzw"))
    for axis in axes
)
AXES = {
    f"{part}.{axis}": first + k
    for first, parts in ((0, ("position", "linear")), (3, ("angular",)))
    for part in parts
    for k, axis in enumerate("xyz")
}
"""Where a coordinate stands in the 6 x 6 covariance beside its pose or twist."""


class ObservationReader:
    """Reads the messages of one entry of the DOF file.

    Args:
        entry: what to read.
        group: which signal it is, or for velocities the signal they are of.
        columns: for velocities, the DOFs of the signal they are of; None for positions.
    """

    def __init__(self, entry: DofEntry, group: int, columns: tuple[int, ...] | None = None):
        self.entry, self.group = entry, group
        self._columns = columns
        self._whole = columns is None and entry.type in POSES
        self._values = partial(_joints, entry) if entry.joints else _fields(entry)
        self._matrix, self._axes = _place_of_covariance(entry)
        self._unknown = np.minimum.outer(self._axes, self._axes) < 0
        self._has_unknown = bool(self._unknown.any())
        self._grid = np.ix_(self._axes, self._axes)
        self.pose_columns = None
        if entry.fields and set(entry.fields) <= set(POSE_FIELDS):
            self.pose_columns = np.array([POSE_FIELDS.index(field) for field in entry.fields])

    def observe(
        self, stamp_ns: int, content: object, covariance: np.ndarray | None = None
    ) -> Observation:
        """What a message tells; NaN means that a value was not measured.

        Args:
            stamp_ns: time of measurement.
            content: the message, rclpy's or a bag's.
            covariance: of the position, (3, 3), instead of the message's own.

        Raises:
            MessageError: a field, or every joint, is missing.
        """
        return self._observation(stamp_ns, self._values(content), self._noise(content, covariance))

    def observe_pose(self, stamp_ns: int, pose: np.ndarray, covariance: np.ndarray) -> Observation:
        """As `observe` of a tracked pose, for entries with `pose_columns`.

        Args:
            stamp_ns: time of measurement.
            pose: position and orientation, (7,).
            covariance: (6, 6).

        Raises:
            MessageError: the entry asks for more than the pose.
        """
        if self.pose_columns is None:
            raise MessageError(
                describe(
                    self.entry.topic,
                    f"fields among {', '.join(POSE_FIELDS)}",
                    ", ".join(self.entry.fields),
                    "A tracked pose has no others; correct the DOF file.",
                )
            )
        return self._observation(stamp_ns, pose[self.pose_columns], self._noise(None, covariance))

    def _observation(
        self, stamp_ns: int, values: np.ndarray, noise: np.ndarray | None
    ) -> Observation:
        dofs, derivative = self._columns, self._columns is not None
        if not self._whole and isnan(np.add.reduce(values)) and not np.all(np.isnan(values)):
            kept = np.flatnonzero(~np.isnan(values))
            values = values[kept]
            dofs = tuple(kept.tolist()) if dofs is None else tuple(dofs[k] for k in kept)
            noise = None if noise is None else noise[np.ix_(kept, kept)]
        return Observation(stamp_ns, self.group, values, noise, dofs, derivative)

    def _noise(self, content: object, covariance: np.ndarray | None) -> np.ndarray | None:
        """The sender's covariance, else that of the DOF file; None where neither is known."""
        if covariance is None and self._matrix is not None:
            covariance = self._matrix(content)
            covariance = None if covariance is None else np.reshape(covariance, (6, 6))
        noise = None if covariance is None else covariance[self._grid]
        if noise is not None and self._has_unknown:
            noise = np.where(self._unknown, 0.0, noise)
        if noise is not None and not noise.any():  # ROS: all zero means unknown
            noise = None
        if noise is None and self.entry.std is not None:
            noise = np.eye(len(self._axes)) * self.entry.std**2
        return noise


def observation_readers(dofs: DofSpec) -> list[ObservationReader]:
    """Those of the observed agent: positions, then velocities."""
    found = [ObservationReader(entry, group) for group, entry in enumerate(dofs.observed)]
    for entry in dofs.velocities:
        group, columns = place_of(dofs.observed, entry.of)
        found.append(ObservationReader(entry, group, columns))
    return found


def _fields(entry: DofEntry) -> Callable[[object], np.ndarray]:
    if any(part.isdigit() for field in entry.fields for part in field.split(".")):
        return partial(extract, entry)
    read, single = attrgetter(*entry.fields), len(entry.fields) == 1

    def values(content: object) -> np.ndarray:
        try:
            found = read(content)
            return np.array([found] if single else found, dtype=np.float64)
        except (AttributeError, TypeError, ValueError):
            return extract(entry, content)  # says what is wrong

    return values


def _joints(entry: DofEntry, content: object) -> np.ndarray:
    """Values (d,) of the joints, NaN for those the message does not have; one must be there."""
    try:
        at = {name: k for k, name in enumerate(content.name)}
        column = getattr(content, entry.quantity)
    except AttributeError:
        return extract(entry, content)
    values = np.full(len(entry.joints), np.nan)
    found = False
    for row, joint in enumerate(entry.joints):
        k = at.get(joint)
        if k is not None and k < len(column):
            values[row], found = column[k], True
    return values if found else extract(entry, content)


def _place_of_covariance(
    entry: DofEntry,
) -> tuple[Callable[[object], object] | None, np.ndarray]:
    """How to find the 6 x 6 matrix in a message, and where the fields stand in it, (m,) or -1."""
    count = len(entry.names)
    axes, holders = np.full(count, -1), set()
    for k, field in enumerate(entry.fields):
        parts = field.split(".")
        axis = AXES.get(".".join(parts[-2:]), -1)
        if axis >= 0:
            axes[k] = axis
            holders.add(".".join([*parts[:-3], "covariance"]))
    if len(holders) != 1:
        return None, axes
    read = attrgetter(*holders)

    def matrix(content: object) -> object:
        try:
            found = read(content)
        except AttributeError:
            return None
        return found if np.size(found) == 36 else None

    return matrix, axes

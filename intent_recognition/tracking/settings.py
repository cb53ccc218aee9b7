# SPDX-License-Identifier: Apache-2.0
"""Settings for checking raw tracker poses, and extrinsics of tracker frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, frozen
from intent_recognition.errors import ArgumentError
from intent_recognition.tracking.transforms import RigidTransform

UNKNOWN_VARIANCE = 1e6
"""Variance of unmeasured quantities: orientation [rad^2], velocity before the third sample
[m^2/s^2] and angular velocity [rad^2/s^2]. It is so large that filters ignore the values."""


@dataclass(frozen=True)
class IngestSettings:
    """Settings for checking raw poses and transforming them to the world frame.

    Attributes:
        world_frame: name of the world frame; poses in it need no extrinsics.
        extrinsics: pose of each tracker frame in the world, as (xyz (3,) [m], quaternion (4,)
            xyzw); poses in other frames than these and the world are rejected.
        max_speed_m_s: highest speed of a step that is not a jump.
        max_gap_s: time without an accepted sample after which any position is accepted.
        position_std_m: tracker noise, one number or one per axis (3,) of the tracker's frame.
        orientation_std_rad: tracker noise about each axis, which `mocap_ingest` attaches [rad].
        reanchor_after: number of consecutive, mutually consistent jumps that begin a new track.
        clock_reset_after: number of consecutive late but increasing stamps that show that a clock
            was set back.
        velocity_window_s: length of the window of accepted samples to which the velocity is fitted.

    Raises:
        ArgumentError: a number is not positive and finite, or an extrinsic is no rigid transform.
    """

    world_frame: str = "world"
    extrinsics: Mapping[str, tuple[ArrayLike, ArrayLike]] = field(default_factory=dict)
    max_speed_m_s: float = 6.0
    max_gap_s: float = 0.5
    position_std_m: float | Floats = 0.002
    orientation_std_rad: float = 0.02
    reanchor_after: int = 5
    clock_reset_after: int = 100
    velocity_window_s: float = 0.1

    def __post_init__(self) -> None:
        for name in (
            "max_speed_m_s",
            "max_gap_s",
            "velocity_window_s",
            "position_std_m",
            "orientation_std_rad",
        ):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not (np.all(np.isfinite(value)) and np.all(value > 0.0)):
                cure = "Correct it."
                raise ArgumentError.about(name, "a finite number above zero", value.tolist(), cure)
        for name in ("reanchor_after", "clock_reset_after"):
            if getattr(self, name) < 1:
                raise ArgumentError.about(name, "at least 1", getattr(self, name), "Raise it.")
        std_m = np.asarray(self.position_std_m, dtype=np.float64)
        if std_m.shape not in ((), (3,)):
            cure = "Give one per axis."
            raise ArgumentError.about("position_std_m", "one number or three", std_m.shape, cure)
        _ = self.frames  # raises for an extrinsic that is not a rigid transform

    @cached_property
    def frames(self) -> Mapping[str, RigidTransform]:
        """Pose of each known frame in the world, by `frame_name`."""
        frames = {frame_name(self.world_frame): RigidTransform.identity()}
        for frame, (translation, quaternion) in self.extrinsics.items():
            frames[frame_name(frame)] = RigidTransform(np.array(translation), np.array(quaternion))
        return frames

    @cached_property
    def covariances(self) -> Mapping[str, Floats]:
        """Covariance (3, 3) [m^2], in world axes, of a position measured in each frame."""
        variances = np.broadcast_to(np.asarray(self.position_std_m) ** 2, (3,))
        covariances = {}
        for frame, transform in self.frames.items():
            covariance = (transform.rotation * variances) @ transform.rotation.T
            covariances[frame] = frozen(0.5 * (covariance + covariance.T))
        return covariances

    @cached_property
    def largest_std_m(self) -> float:
        """Tracker noise along its worst axis [m]."""
        return float(np.max(self.position_std_m))

    @cached_property
    def margin_m(self) -> float:
        """Largest distance between two samples of a body at rest [m]."""
        return 6.0 * self.largest_std_m  # noise exceeds it once in 10^8


def frame_name(frame_id: str) -> str:
    """`frame_id` without a leading slash, as tf2 names frames."""
    return frame_id.removeprefix("/")


Extrinsics = dict[str, tuple[Floats, Floats]]
"""Position (3,) [m] and quaternion (4,) xyzw of each tracker frame in the world."""


def parse_extrinsics(entries: Sequence[str], argument: str = "extrinsics") -> Extrinsics:
    """Parse entries 'frame x y z qx qy qz qw' [m, quaternion], ignoring empty ones.

    Raises:
        ArgumentError: an entry does not have eight fields, a field is not a finite number, the
            quaternion is zero, or a frame occurs twice.
    """
    extrinsics: Extrinsics = {}
    known: set[str] = set()
    for index, entry in enumerate(entries):
        fields = entry.split()
        if not fields:
            continue
        frame, *numbers = fields
        pose = _pose(numbers)
        if pose is None or frame_name(frame) in known:
            expected = "one 'frame x y z qx qy qz qw' for each tracker frame"
            cure = "Give each frame once, metres and a quaternion."
            raise ArgumentError.about(f"{argument}[{index}]", expected, repr(entry), cure)
        known.add(frame_name(frame))
        extrinsics[frame] = pose
    return extrinsics


def _pose(numbers: Sequence[str]) -> tuple[Floats, Floats] | None:
    try:
        values = np.array([float(number) for number in numbers])
        RigidTransform(values[:3], values[3:])  # raises for invalid poses
    except ValueError:
        return None
    return values[:3], values[3:]

# SPDX-License-Identifier: Apache-2.0
"""JointTrajectory messages in one call."""

from collections.abc import Sequence

from numpy.typing import ArrayLike
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.nodes.conversions import TrajectoryBuilder


def build_joint_trajectory(
    names: Sequence[str], times_s: ArrayLike, *values: ArrayLike | None, time_ns: int = 0
) -> JointTrajectory:
    """A new message; `values` as of `TrajectoryBuilder.build`: positions, velocities, efforts."""
    return TrajectoryBuilder(names).build(time_ns, times_s, *values)

# SPDX-License-Identifier: Apache-2.0
"""Conversion of a predicted trajectory to a path of the arm's joints, or to a rejection."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics import Arm, JointLimits
from intent_recognition.motion import JointPath, check_range, is_hand, joints_along, make_path
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.diagnostics import RejectionError
from intent_recognition.signals import POSITION_FIELDS


class PredictionNumbers(NamedTuple):
    """Contents of a message with a prediction: times (T,) [s] from the stamp, and arrays (T, d).

    The onset is 0 without a stamp. `of_hand` is whether the columns are those of a hand instead of
    joints, and `end_std` the largest standard deviation at the end, by unit.
    """

    label: str
    onset_ns: int
    of_hand: bool
    times_s: Floats
    positions: Floats
    velocities: Floats | None
    end_std: Mapping[str, float] | None


def read_prediction(message: JointTrajectory) -> PredictionNumbers:
    """Read a message with a prediction.

    Raises:
        RejectionError: the prediction cannot be acted on.
        MessageError: the points have different numbers of values.
    """
    label, of_hand = message.header.frame_id, is_hand(tuple(message.joint_names))
    if not label:
        raise RejectionError("no_task", "intent/robot_trajectory without a task in frame_id")
    times_s, positions, rest = trajectory_arrays(message)
    if len(times_s) < 2:
        raise RejectionError("too_few_points", f"intent/robot_trajectory of {len(times_s)} points")
    if not all(np.all(np.isfinite(array)) for array in (times_s, positions, *rest.values())):
        raise RejectionError("not_finite", "intent/robot_trajectory holds NaN or infinity")
    if times_s[0] < 0.0 or np.min(np.diff(times_s)) <= 0.0:
        raise RejectionError("non_monotone_times", "time_from_start of intent/robot_trajectory")
    end_std = None
    if "effort" in rest:
        std, n_metres = rest["effort"][-1], len(POSITION_FIELDS) if of_hand else 0
        parts = {"m": std[:n_metres], "rad": std[n_metres:]}
        end_std = {unit: float(part.max()) for unit, part in parts.items() if part.size}
    onset_ns = stamp_ns(message) and stamp_ns(message) + round(float(times_s[0]) * 1e9)
    return PredictionNumbers(
        label, onset_ns, of_hand, times_s, positions, rest.get("velocities"), end_std
    )


def joint_path(
    limits: JointLimits,
    times_s: Floats,
    positions: Floats,
    velocities: Floats | None,
    *,
    hand_of: tuple[Arm, Floats] | None = None,
) -> JointPath:
    """Make a path of the arm's joints from positions (T, n) [rad] at increasing times (T,) [s].

    Velocities (T, n) [rad/s] that are None follow from the positions. With `hand_of`, an arm and
    the posture (n,) [rad] that its joints are drawn to, the positions (T, 3 or 7) are of its hand.

    Raises:
        RejectionError: the hand cannot reach a position, or a joint would leave its range.
    """
    if hand_of is not None:
        (arm, rest), velocities = hand_of, None
        try:
            times_s, positions = joints_along(arm, times_s, positions, rest)
        except TrajectoryError as error:
            raise RejectionError("unreachable", str(error)) from error
    try:
        check_range(positions, limits)
    except TrajectoryError as error:
        raise RejectionError("outside_range", str(error)) from error
    return make_path(times_s, positions, limits, velocities)

# SPDX-License-Identifier: Apache-2.0
"""Every kind of bad trajectory is refused whole, with its reason."""

from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import array_shapes, arrays
from hypothesis.strategies import floats

from intent_recognition.errors import TrajectoryError
from intent_recognition.kinematics.lwr import JOINT_NAMES
from sim_bridge.arm.trajectory_command import REASONS, RejectedTrajectoryError, TrajectoryCommand

NAMES = list(JOINT_NAMES)
TIMES = [0.5, 1.0]
ROWS = [[0.1] * 7, [0.2] * 7]
REST = [[0.1] * 7, [0.0] * 7]
NAN, INF = float("nan"), float("inf")


def row(value, joint=2):
    values = [0.1] * 7
    values[joint] = value
    return values


CASES = {
    "no names": ("wrong_joint_names", ([], TIMES, ROWS), {}),
    "one name missing": ("wrong_joint_names", (NAMES[:6], TIMES, ROWS), {}),
    "one name twice": ("wrong_joint_names", ([*NAMES[:6], NAMES[0]], TIMES, ROWS), {}),
    "one name unknown": ("wrong_joint_names", ([*NAMES[:6], "elbow"], TIMES, ROWS), {}),
    "one name too many": ("wrong_joint_names", ([*NAMES, "gripper"], TIMES, ROWS), {}),
    "no points": ("empty", (NAMES, [], []), {}),
    "six positions": ("wrong_size", (NAMES, TIMES, [[0.1] * 7, [0.1] * 6]), {}),
    "no positions": ("wrong_size", (NAMES, TIMES, [[], []]), {}),
    "eight velocities": ("wrong_size", (NAMES, TIMES, ROWS, [[0.1] * 8, [0.0] * 8]), {}),
    "velocities in one row only": ("wrong_size", (NAMES, TIMES, ROWS, [[], [0.0] * 7]), {}),
    "five accelerations": ("wrong_size", (NAMES, TIMES, ROWS, REST, [[0.0] * 5] * 2), {}),
    "rows missing": ("wrong_size", (NAMES, TIMES, ROWS[:1]), {}),
    "nan position": ("not_finite", (NAMES, TIMES, [ROWS[0], row(NAN)]), {}),
    "infinite position": ("not_finite", (NAMES, TIMES, [row(INF), ROWS[1]]), {}),
    "nan velocity": ("not_finite", (NAMES, TIMES, ROWS, [row(NAN), REST[1]]), {}),
    "nan acceleration": ("not_finite", (NAMES, TIMES, ROWS, REST, [row(NAN), REST[1]]), {}),
    "nan time": ("not_finite", (NAMES, [0.5, NAN], ROWS), {}),
    "nan stamp": ("not_finite", (NAMES, TIMES, ROWS), {"start_s": NAN}),
    "times equal": ("time_not_increasing", (NAMES, [0.5, 0.5], ROWS), {}),
    "times backward": ("time_not_increasing", (NAMES, [1.0, 0.5], ROWS), {}),
    "time negative": ("time_not_increasing", (NAMES, [-0.1, 0.5], ROWS), {}),
    "position outside": ("outside_position_limits", (NAMES, [2, 9], [row(3.0), ROWS[1]]), {}),
    "velocity outside": ("outside_velocity_limits", (NAMES, TIMES, ROWS, [row(9.0), REST[1]]), {}),
    "mean velocity outside": ("outside_velocity_limits", (NAMES, [0.1, 0.2], [row(0), row(1)]), {}),
    "acceleration outside": (
        "outside_acceleration_limits",
        (NAMES, TIMES, ROWS, REST, [row(50.0), REST[1]]),
        {},
    ),
    "moving at the end": ("velocity_at_end", (NAMES, TIMES, ROWS, [REST[0], row(0.2)]), {}),
    "over before it came": ("ends_in_past", (NAMES, TIMES, ROWS), {"start_s": 1.0, "now_s": 9.0}),
    "stamp of another clock": ("starts_too_late", (NAMES, TIMES, ROWS), {"start_s": 1.7e9}),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_trajectory(case):
    reason, arguments, options = CASES[case]
    with pytest.raises(RejectedTrajectoryError, match="keeps what it was doing") as caught:
        TrajectoryCommand.validated(*arguments, **options)
    assert caught.value.reason == reason
    assert isinstance(caught.value, TrajectoryError)


@pytest.mark.parametrize(
    "pushed, first, end, taken",
    [
        (2.99, 2.99, 2.98, True),
        (2.99, 2.98, 2.97, True),
        (2.99, 2.98, 2.985, False),
        (2.97, 2.98, 2.975, False),
        (2.9, 2.99, 2.98, False),
    ],
)
def test_an_arm_pushed_past_a_limit_may_brake_there_but_end_no_farther_out(
    pushed, first, end, taken
):
    command = NAMES, TIMES, [row(first), row(end)]  # the limit is 2.967
    with nullcontext() if taken else pytest.raises(RejectedTrajectoryError, match="points"):
        TrajectoryCommand.validated(*command, position=np.array(row(pushed)))


def test_every_reason_has_a_case_and_a_good_one_passes():
    assert {reason for reason, _, _ in CASES.values()} == {*REASONS} - {"cannot_join"}
    command = TrajectoryCommand.validated(NAMES, TIMES, ROWS, [[], []], [[], []])
    assert command.accelerations is None
    assert command.positions.shape == command.velocities.shape == (2, 7)


@settings(deadline=None)
@given(
    arrays(np.float64, array_shapes(min_dims=1, max_dims=1, max_side=4), elements=floats()),
    arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=floats()),
)
def test_any_rubbish_is_either_valid_or_rejected_with_a_reason(times, positions):
    try:
        command = TrajectoryCommand.validated(NAMES, times, positions)
    except RejectedTrajectoryError as error:
        assert error.reason in REASONS
    else:
        assert np.all(np.isfinite(command.positions))

# SPDX-License-Identifier: Apache-2.0
"""A shown demonstration begins and ends at rest, where it should, and is smooth between."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from intent_recognition.dashboard.synthetic_demonstration import (
    SyntheticDemonstration,
    arm_motion,
    sample_demonstration,
    shortest_s,
)
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS, RATE_TOLERANCE
from intent_recognition.motion import Offset
from sim_bridge.arm.trajectory_command import TrajectoryCommand

POINTS = arrays(float, 3, elements=st.floats(-1.0, 1.0))


@pytest.mark.slow
@given(POINTS, POINTS, st.floats(0.8, 4.0))
def test_wrist_rests_at_its_start_and_at_its_goal(start, goal, duration):
    show = SyntheticDemonstration(start, goal, np.array([0.0, 0.0, 0.05]), duration)
    for at in (0.0, show.rest_s):
        assert np.allclose(show.wrist(at), start)
    for at in (show.rest_s + duration, show.length_s):
        assert np.allclose(show.wrist(at), goal)


@given(POINTS, POINTS, st.integers(0, 1000))
def test_goals_of_wrist_and_hand_shift_together(start, goal, seed):
    drawn, shift = sample_demonstration(np.random.default_rng(seed), start, goal, 2.0, 0.03)
    assert np.allclose(drawn.goal_m, goal + shift)
    assert abs(drawn.bow_m @ (drawn.goal_m - start)) < 1e-9
    assert 1.4 <= drawn.duration_s <= 2.6


def test_the_arm_moves_from_rest_to_rest_within_its_time():
    start, goal = np.zeros(7), np.linspace(-1.0, 1.0, 7)
    times, q, qd = arm_motion(start, goal, 1.7)
    assert times[0] == 0.0
    assert times[-1] == 1.7
    assert np.allclose(q[[0, -1]], [start, goal])
    assert np.allclose(qd[[0, -1]], 0.0)
    slopes = (q[2:] - q[:-2]) / (times[2:] - times[:-2])[:, None]
    assert np.max(np.abs(slopes - qd[1:-1])) < 0.02


@given(st.integers(0, 1000))
def test_the_shortest_motion_keeps_the_limits_and_reaches_one(seed):
    start, goal = np.random.default_rng(seed).uniform(LWR_LIMITS.lower, LWR_LIMITS.upper, (2, 7))
    duration = shortest_s(goal - start, LWR_LIMITS)
    motion = Offset(start - goal, np.zeros(7), np.zeros(7), duration).largest()
    shares = np.array(motion) / (LWR_LIMITS.velocity, LWR_LIMITS.acceleration)
    assert 0.98 < shares.max() <= 1.0 + RATE_TOLERANCE
    TrajectoryCommand.validated(JOINT_NAMES, *arm_motion(start, goal, duration))


def test_the_arm_follows_the_human():
    show = SyntheticDemonstration(np.zeros(3), np.ones(3), np.zeros(3), 2.0)
    assert show.arm_start_s > show.rest_s
    assert show.arm_start_s + show.arm_duration_s > show.rest_s + show.duration_s

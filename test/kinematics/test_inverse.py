# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics: round trips, branches, continuity, refusal out of reach."""

from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis.strategies import builds, floats, sampled_from, tuples

from intent_recognition.errors import KinematicsError, ShapeError
from intent_recognition.kinematics import Branch, inverse_kinematics, reach_position, solve
from intent_recognition.kinematics.inverse import branch_of, swivel_angle
from intent_recognition.kinematics.limits import within_position_limits
from intent_recognition.kinematics.lwr import LWR_LIMITS, forward_kinematics, hand_position

BRANCHES = [Branch(*signs) for signs in product((1, -1), repeat=3)]
shares = tuples(*[floats(-0.98, 0.98)] * 7)
postures = builds(lambda share: np.array(share) * LWR_LIMITS.upper, shares)
READY = np.array([0.2, -0.5, 0.1, 1.5, 0.2, -1.0, 0.3])


@settings(deadline=None)
@given(postures, floats(-3.1, 3.1), sampled_from(BRANCHES))
def test_every_closed_form_solution_reaches_the_pose(q, swivel, branch):
    pose = forward_kinematics(q)
    assert np.allclose(forward_kinematics(solve(pose, swivel, branch)), pose, atol=1e-7)


@settings(deadline=None)
@given(postures)
def test_swivel_and_branch_give_the_posture_back(q):
    """Away from the singular postures, where joints line up and share a rotation."""
    if np.abs(np.sin(q[[1, 3, 5]])).min() < 1e-2 or np.hypot(*hand_position(q)[:2]) < 1e-2:
        return
    assert np.allclose(solve(forward_kinematics(q), swivel_angle(q), branch_of(q)), q, atol=1e-6)


BETWEEN_GRID_POINTS = np.array([0.0, 0.5, 0.125, 0.75, 0.9375, 0.03125, 0.875]) * LWR_LIMITS.upper
"""Near a wrist singularity: the solutions inside the limits span a few degrees of swivel."""
BESIDE_A_GRID_POINT = (
    np.array([0.5, 0.978515625, -0.3125, -0.5, 0.0001, 0.625, 0.5]) * LWR_LIMITS.upper
)
"""The extreme swivel of the wrist and a grid point differ by rounding."""


@settings(max_examples=40, deadline=None)
@given(postures, shares)
@example(BETWEEN_GRID_POINTS, (0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0))
@example(BESIDE_A_GRID_POINT, (0.0, -0.5, 0.0, 0.0, 0.5, 0.0, 0.0))
def test_nearest_solution_is_inside_limits_and_not_farther_than_a_known_one(q, nudge):
    seed = np.clip(q + 0.1 * np.array(nudge), LWR_LIMITS.lower, LWR_LIMITS.upper)
    found = inverse_kinematics(forward_kinematics(q), seed)
    assert within_position_limits(found, LWR_LIMITS)
    assert np.allclose(forward_kinematics(found), forward_kinematics(q), atol=1e-7)
    if np.abs(np.sin(q[[1, 3, 5]])).min() < 0.05:
        return  # where joints line up, their shares of the rotation are arbitrary
    assert np.linalg.norm(found - seed) <= np.linalg.norm(q - seed) + 1e-7


@settings(deadline=None)
@given(postures, shares)
def test_reach_position_reaches_a_near_position(q, nudge):
    inside = np.clip(q, 0.8 * LWR_LIMITS.lower, 0.8 * LWR_LIMITS.upper)
    if np.abs(np.sin(inside[[1, 3, 5]])).min() < 0.1:
        return
    found = reach_position(hand_position(inside), inside + 0.05 * np.array(nudge))
    assert np.allclose(hand_position(found), hand_position(inside), atol=1e-4)


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((2.0, 0.0, 0.3885), r"1\.210"),  # too far by so much, or too near
        ((0.0, 0.0, 0.3885), r"0\.010"),
        ((0.2, 0.0, 0.3885), "joint limits"),
    ],
)
def test_what_is_out_of_reach_is_named_with_the_distance(position, words):
    pose = np.eye(4)
    pose[:3, 3] = position
    with pytest.raises(KinematicsError, match=words):
        inverse_kinematics(pose, READY)


def test_what_is_no_pose_and_positions_out_of_reach_are_named():
    with pytest.raises(KinematicsError, match=r"m away"):
        reach_position(np.array([1.5, 0.0, 0.3]), READY)
    with pytest.raises(ShapeError):
        inverse_kinematics(np.eye(3), READY)
    with pytest.raises(KinematicsError, match="finite"):
        inverse_kinematics(np.full((4, 4), np.nan), READY)
    with pytest.raises(ShapeError, match="position_m"):
        reach_position(np.full(3, np.nan), READY)

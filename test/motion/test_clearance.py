# SPDX-License-Identifier: Apache-2.0
"""Paths bent away from boxes within the spread of their task, or refused with the bodies named."""

import numpy as np
import pytest
from activation_world import GOALS, LIMITS
from clearance_world import (
    ARM,
    BASIS,
    PATH,
    POSITIONS,
    TIMES,
    box_beside,
    clearance,
    plan_along,
    primitive,
)
from scipy.spatial.transform import Rotation

from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.kinematics import Box, hand_position
from intent_recognition.motion import ClearPath, Obstruction, make_path
from intent_recognition.motion.bending import Spread, _position_rows, least_change
from intent_recognition.motion.plan import POSITION_MARGIN_RAD
from intent_recognition.promp import via_point
from intent_recognition.signals import to_tangent


def test_one_row_is_conditioning_on_a_via_point():
    rng = np.random.default_rng(0)
    half = rng.normal(size=(12, 12))
    prior = Gaussian(np.zeros(12), half @ half.T)
    row, need = rng.normal(size=(1, 12)), np.array([0.7])
    z = least_change(row @ half, need)
    posterior, _ = condition(prior, row, need, np.zeros((1, 1)))
    weights = half @ z
    np.testing.assert_allclose(weights, posterior.mean, rtol=1e-6)
    mahalanobis = weights @ np.linalg.solve(prior.covariance, weights)
    assert np.linalg.norm(z) == pytest.approx(np.sqrt(mahalanobis), rel=1e-6)


def test_rows_that_hold_change_nothing_and_needs_that_contradict_one_another_have_no_answer():
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(3, 5))
    np.testing.assert_array_equal(least_change(rows, np.array([-1.0, -0.1, -2.0])), np.zeros(5))
    z = least_change(rows, np.array([0.5, -9.0, 0.2]))
    assert np.all(rows @ z >= [0.5 - 1e-6, -9.0, 0.2 - 1e-6])
    row = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]])
    assert least_change(row[:2], np.array([1.0, 1.0])) is None
    assert least_change(row[2:], np.array([1.0])) is None


def test_rows_lead_each_joint_that_is_outside_equally_far_inside():
    rng, q = np.random.default_rng(2), np.zeros((3, 7))
    q[0, 1], q[2, 4] = LIMITS.upper[1] + 0.1, LIMITS.lower[4] - 0.2
    z, moves = rng.normal(size=9), rng.normal(size=(3, 7, 9))
    rows, needs = _position_rows(q, moves, z, LIMITS)
    after = q + moves @ (np.linalg.lstsq(rows, needs, rcond=None)[0] - z)
    inside = POSITION_MARGIN_RAD + 0.005
    expected = [LIMITS.upper[1] - inside, LIMITS.lower[4] + inside]
    np.testing.assert_allclose([after[0, 1], after[2, 4]], expected)


def test_a_spread_keeps_both_ends_and_is_that_of_via_points():
    one = primitive()
    spread = Spread.of(one)
    phases = np.linspace(0.0, 1.0, 21)
    design = spread.design(phases, np.zeros((21, 7)))
    variance = np.einsum("tjm,mk,tjk->tj", design, spread.covariance, design)
    np.testing.assert_allclose(variance[[0, -1]], 0.0, atol=1e-12)
    fixed = one
    for time_s in (0.0, 2.0):
        fixed = via_point(fixed, time_s, np.zeros(7), keep_observed=False)
    expected = fixed.predict_controlled(21).std ** 2 - 1e-6
    np.testing.assert_allclose(variance, expected, atol=1e-9)


def test_a_clear_path_is_the_path_itself_and_what_is_past_does_not_count():
    guard = clearance(Box("far", (0.0, 0.0, 3.0), (0.1, 0.1, 0.1)))
    found = guard.clear(PATH, "plate", 0.0, LIMITS, tries=0)
    assert found == ClearPath(PATH) and found.path is PATH
    assert guard.obstruction(plan_along(PATH)) is None
    guard = clearance(box_beside(0.02), largest=0.0, replan_budget_s=0.0)
    assert isinstance(guard.clear(PATH, "plate", 0.0, LIMITS), Obstruction)
    assert guard.clear(PATH, "plate", 0.9, LIMITS).path is PATH


@pytest.mark.parametrize("depth_m", [0.0, 0.02, 0.04])
def test_a_path_that_touches_is_bent_between_its_ends(depth_m):
    guard = clearance(box_beside(depth_m))
    plan = plan_along(PATH)
    before = guard.obstruction(plan)
    assert before is not None and before.bodies[1] == "crate"
    assert guard.obstruction(plan, -1.0) == before
    assert guard.obstruction(plan, plan.duration_s + 1.0) is None
    found = guard.clear(PATH, "plate", 0.0, LIMITS)
    assert found.how == "bent" and guard.obstruction(plan_along(found.path)) is None
    np.testing.assert_allclose(found.path.spline([0.0, 1.0]), PATH.spline([0.0, 1.0]), atol=1e-9)
    z = whitened(found, Spread.of(primitive()))
    assert 0.0 < np.linalg.norm(z) <= 3.0 * (1 + 1e-3)


def whitened(found, spread):
    """The least standard normal numbers by which a path was moved."""
    phases = np.linspace(0.0, 1.0, len(found.away))
    moves = spread.moves(phases, PATH.spline(phases))
    table = moves.reshape(-1, moves.shape[2])
    z = np.linalg.lstsq(table, found.away.ravel(), rcond=1e-8)[0]
    np.testing.assert_allclose(table @ z, found.away.ravel(), atol=1e-5)
    return z


def test_what_is_beyond_the_spread_is_refused_by_name_where_nothing_is_planned_anew():
    guard = clearance(box_beside(0.04), largest=0.2, replan_budget_s=0.0)
    found = guard.clear(PATH, "plate", 0.0, LIMITS, tries=0)
    assert isinstance(found, Obstruction) and found.bodies[1] == "crate"
    assert "would touch crate at phase 0." in str(found)
    unknown = clearance(box_beside(0.04), spreads={}, replan_budget_s=0.0)
    assert unknown.clear(PATH, "plate", 0.0, LIMITS) == found


def test_a_bend_is_kept_while_it_serves():
    guard = clearance(box_beside(0.02))
    first = guard.clear(PATH, "plate", 0.0, LIMITS)
    before = first._replace(away=1.1 * first.away)
    shifted = make_path(TIMES, POSITIONS + 1e-3, LIMITS)
    again = guard.clear(shifted, "plate", 0.1, LIMITS, before)
    assert again.away is before.away and again.how == "bent"


def test_a_hands_spread_bends_the_joints():
    spreads = {"plate": Spread.of(primitive(3, 0.03), ARM)}
    guard = clearance(box_beside(0.02), spreads=spreads)
    found = guard.clear(PATH, "plate", 0.0, LIMITS)
    assert found.how == "bent" and guard.obstruction(plan_along(found.path)) is None
    spread = spreads["plate"]
    weights = spread.root @ whitened(found, spread)
    phase = np.linspace(0.0, 1.0, 11)
    moved = hand_position(found.path.spline(phase)) - hand_position(PATH.spline(phase))
    wanted = BASIS.design_matrix(phase) @ weights.reshape(3, -1).T
    np.testing.assert_allclose(moved, wanted, atol=4e-3)


def test_weights_of_a_whole_pose_move_the_hand_as_they_say():
    """Against the forward kinematics a small step farther: metres, and rotation vectors."""
    rng, q, step = np.random.default_rng(3), POSITIONS[::10], 1e-6
    turns = ARM.forward_kinematics(q)[:, :3, :3]
    reference = (Rotation.from_matrix(turns[0]) * Rotation.from_rotvec([0.3, -0.5, 0.9])).as_quat()
    n = BASIS.n_basis
    spread = Spread(BASIS, np.eye(6 * n), ARM, tuple(reference))
    weights, phase = rng.normal(size=6 * n), np.linspace(0.0, 1.0, len(q))

    def hand(joints):
        poses = ARM.forward_kinematics(joints)
        quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
        return np.hstack([poses[:, :3, 3], to_tangent(quaternions, reference)])

    moved = (hand(q + step * (spread.design(phase, q) @ weights)) - hand(q)) / step
    expected = BASIS.design_matrix(phase) @ weights.reshape(6, n).T
    np.testing.assert_allclose(moved, expected, atol=1e-3)


def test_a_plan_subdivided_is_the_plan_and_joints_turn_no_farther_than_said():
    path = make_path(TIMES * 0.2, POSITIONS, LIMITS)
    plan = plan_along(path)
    positions, travel = plan.subdivided(7)
    np.testing.assert_allclose(positions[::7], plan.positions, atol=1e-12)
    t = np.interp(np.arange(len(positions)) / 7.0, np.arange(len(plan.times_s)), plan.times_s)
    np.testing.assert_allclose(positions, [plan.at(float(x)).position for x in t], atol=1e-9)
    assert np.all(travel >= np.abs(np.diff(positions, axis=0)) - 1e-12)
    assert np.all(travel.sum(axis=0) >= np.abs(GOALS["plate"]) - 1e-9)

# SPDX-License-Identifier: Apache-2.0
"""The pole: geometry, ways around it, lessons in physics, execution."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.pole import recordings
from experiments.pole.geometry import (
    HOME,
    LEFT,
    MIRROR,
    POINTING_HEIGHT_M,
    POLE_M,
    POLE_RADIUS_M,
    RIGHT,
    WAYS,
    fingertip,
    planned_clearance,
    way_of,
    winding,
)
from experiments.pole.plan import CLEARANCE_M, LEAST_CLEARANCE_M, REACHED_M, can_reach, plan_way
from experiments.pole.world import Pole, execute
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics.lwr import LWR_LIMITS
from sim_bridge.arm.arm import SimulatedArm

SPOT = np.array([0.57, 0.0])
SHARES = np.linspace(0.0, 1.0, 60)


@given(st.floats(-3.0, 3.0), st.integers(3, 40))
def test_winding_of_an_arc_is_its_angle(angle, count):
    turn = np.linspace(0.0, angle, count)
    arc = POLE_M + 0.3 * np.column_stack((np.cos(turn), np.sin(turn)))
    assert winding(arc) == pytest.approx(angle, abs=1e-9)


def test_the_mirrored_arm_is_the_mirror_of_the_arm():
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 7))
    np.testing.assert_allclose(fingertip(q * MIRROR), fingertip(q) * [1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(planned_clearance(q * MIRROR), planned_clearance(q), atol=1e-12)


@pytest.mark.parametrize("way", WAYS)
def test_a_way_points_at_the_spot_on_its_side_and_stays_clear(way):
    path = plan_way(SPOT, way).at(SHARES)
    tip = fingertip(path)
    assert np.linalg.norm(tip[-1] - [*SPOT, POINTING_HEIGHT_M]) < REACHED_M
    assert way_of(tip) == way
    assert planned_clearance(path).min() >= LEAST_CLEARANCE_M
    assert np.all((path > LWR_LIMITS.lower) & (path < LWR_LIMITS.upper))
    np.testing.assert_array_equal(path[0], HOME)


def test_the_middle_of_both_ways_runs_through_the_pole():
    both = [plan_way(SPOT, way).at(SHARES) for way in WAYS]
    assert planned_clearance(np.mean(both, axis=0)).min() < -POLE_RADIUS_M


def test_far_spots_are_reached_on_their_own_side_only():
    far = np.array([0.57, 0.17])
    assert can_reach(far, LEFT) and not can_reach(far, RIGHT)
    assert can_reach(far * [1, -1], RIGHT) and not can_reach(far * [1, -1], LEFT)
    with pytest.raises(KinematicsError, match="by the right of the pole"):
        plan_way(far, RIGHT)


def test_neighbouring_spots_have_neighbouring_postures():
    ends = np.array([plan_way(np.array([0.57, y]), LEFT).end for y in np.linspace(-0.05, 0.15, 21)])
    assert np.abs(np.diff(ends, axis=0)).max() < 0.15  # no branch is changed


def test_planned_clearance_is_a_cautious_estimate_of_that_in_physics():
    path = plan_way(SPOT, LEFT).at(SHARES[::4])
    with SimulatedArm(path[0]) as arm:
        pole = Pole(arm)
        for q, planned in zip(path, planned_clearance(path), strict=True):
            arm.reset(q)
            assert max(planned - 0.012, 0.5 * CLEARANCE_M) <= pole.clearance(q)


@pytest.mark.slow
def test_execution_tells_a_motion_beside_the_pole_from_one_through_it():
    times = 2.5 * SHARES
    ways = {way: plan_way(SPOT, way).at((1 - np.cos(np.pi * SHARES)) / 2) for way in WAYS}
    beside = execute(ways[LEFT], times, rest_s=0.3)
    assert not beside.touched and beside.clearance_m.min() > 0.02
    assert np.linalg.norm(fingertip(beside.positions_rad[-1]) - fingertip(ways[LEFT][-1])) < 0.01
    assert execute(np.mean(list(ways.values()), axis=0), times, rest_s=0.3).touched


def test_the_orders_are_14_on_either_side_and_nine_spots_on_both():
    orders = recordings.orders(3)
    by_way = {way: {o.spot for o in orders if o.way == way} for way in WAYS}
    assert [len(by_way[way]) for way in WAYS] == [14, 14]
    assert len(by_way[LEFT] & by_way[RIGHT]) == 9
    assert len({o.folder for o in orders}) == len({o.start_ns for o in orders}) == 28


@pytest.mark.slow
def test_a_lesson_is_led_on_its_side_and_depends_on_its_order_alone():
    order = recordings.orders(1)[0]
    first, again = recordings.demonstrate(order), recordings.demonstrate(order)
    np.testing.assert_array_equal(first.lesson.positions_rad, again.lesson.positions_rad)
    np.testing.assert_array_equal(
        first.pointing.samples.positions_m, again.pointing.samples.positions_m
    )
    told = recordings.metadata(first)
    assert told["way"] == way_of(fingertip(first.lesson.positions_rad)) == order.way
    assert "task" not in told
    assert first.lesson.clearance_m.min() > recordings.TOUCH_M
    assert float(told["teaching_error_m"]) < 0.03
    assert 1.0 < first.lesson.strongest_pull_n < 60.0

# SPDX-License-Identifier: Apache-2.0
"""Speed by the predicted distance: the formula's own equation, and plans that keep it."""

import numpy as np
import pytest
from clearance_world import ARM, FAR_M, PATH, person, plan_along

from intent_recognition.errors import ArgumentError
from intent_recognition.motion import Separation
from intent_recognition.motion.retiming import N_GRID
from intent_recognition.motion.separation import (
    PredictedPerson,
    SeparationSettings,
    permitted_speed,
    phase_times_ns,
)

SETTINGS = SeparationSettings()
SEPARATION = Separation(ARM, SETTINGS)
PHASES = np.linspace(0.0, 1.0, N_GRID + 1)
ON_PATH = PATH.spline(PHASES)
PLAN = plan_along()
TIMES_NS = phase_times_ns(PLAN, 0)


def test_the_permitted_speed_solves_the_formula():
    s = SETTINGS
    distance = np.linspace(0.5, 3.0, 20)
    v = permitted_speed(distance, s)
    stop_s = v / s.deceleration_m_s2
    needed = (
        s.human_speed_m_s * (s.reaction_s + stop_s)
        + v * s.reaction_s
        + v**2 / (2.0 * s.deceleration_m_s2)
        + s.intrusion_m
    )
    above = v > s.least_speed_m_s
    assert above.sum() > 15
    np.testing.assert_allclose(needed[above], distance[above])
    assert np.all(np.diff(v) >= 0.0)
    np.testing.assert_array_equal(permitted_speed([-1.0, 0.0, 0.26], s), 0.1)
    # by hand: 1.6 (0.1 + 1 / 3) + 0.1 + 1 / 6 + 0.1
    np.testing.assert_allclose(permitted_speed(1.06, s), 1.0)


@pytest.mark.parametrize(
    ("name", "value"), [("least_speed_m_s", 0.0), ("reaction_s", -1.0), ("human_speed_m_s", np.nan)]
)
def test_settings_that_mean_no_bound_are_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name}: expected a finite number"):
        SeparationSettings(**{name: value})


def test_distance_is_from_the_lines_through_the_joints_less_the_tube():
    q = np.zeros((1, 7))
    points = ARM.skeleton(q)
    np.testing.assert_allclose(points[0, -1], ARM.forward_kinematics(q[0])[:3, 3], atol=1e-12)
    assert np.all(np.abs(points[0, :, :2]) < 1e-9)  # it points straight up
    aside = np.array([0.7, 0.0, 0.5 * points[0, -1, 2]])
    found = SEPARATION.distance_m(points, np.zeros(1), person(aside, std=0.05))
    np.testing.assert_allclose(found, 0.7 - 2.0 * 0.05)


@pytest.mark.parametrize(("place", "std"), [(FAR_M, np.nan), (FAR_M * np.nan, 0.0)])
def test_a_person_whose_place_is_not_known_counts_as_touching(place, std):
    touching = PATH.spline(0.5)
    expected = SEPARATION.excess(PLAN, 0, person(ARM.skeleton(touching[None])[0, -1], std=10.0))
    assert expected > 1.0
    assert SEPARATION.excess(PLAN, 0, person(place, std=std)) >= expected


def test_a_person_who_is_far_away_changes_nothing():
    assert SEPARATION.excess(PLAN, 0, person(FAR_M)) < 1.0
    slow = plan_along(PATH, SEPARATION.rate_ceiling(PATH, TIMES_NS, person(FAR_M), ON_PATH))
    np.testing.assert_allclose(slow.positions, PLAN.positions, atol=1e-9)


def test_the_predicted_tube_counts_and_not_where_the_person_is():
    """Far away now, near when the arm will be there; a wider tube is nearer."""
    goal = ARM.forward_kinematics(PATH.spline(1.0))[:3, 3]
    coming = PredictedPerson(
        np.array([0, 1_500_000_000]), np.array([FAR_M, goal]), np.array([0.0, 0.0])
    )
    assert SEPARATION.excess(PLAN, 0, coming) > 1.5
    ceiling = SEPARATION.rate_ceiling(PATH, TIMES_NS, coming, ON_PATH)
    unsure = coming._replace(std=np.array([0.0, 0.2]))
    wider = SEPARATION.rate_ceiling(PATH, TIMES_NS, unsure, ON_PATH)
    assert np.all(wider <= ceiling) and np.any(wider < 0.9 * ceiling)
    slow = plan_along(PATH, ceiling)
    assert slow.duration_s > PLAN.duration_s
    np.testing.assert_allclose(slow.end, PLAN.end, atol=1e-9)


def test_an_arm_off_its_path_is_as_slow_as_where_it_is_permits():
    beside = ON_PATH + 0.4 * (1.0 - PHASES[:, None]) * np.eye(7)[0]
    who = person(ARM.forward_kinematics(beside[0])[:3, 3] + [0.3, 0.0, 0.0])
    ceiling = SEPARATION.rate_ceiling(PATH, TIMES_NS, who, ON_PATH)
    off = SEPARATION.rate_ceiling(PATH, TIMES_NS, who, beside)
    points = ARM.skeleton(ON_PATH)
    way = np.linalg.norm(np.gradient(points, PHASES, axis=0), axis=2).max(axis=1)
    distances = [
        SEPARATION.distance_m(one, TIMES_NS, who) for one in (points, ARM.skeleton(beside))
    ]
    assert 0 < np.sum(distances[1] < distances[0]) < len(PHASES)
    for found, distance in ((ceiling, distances[0]), (off, np.minimum(*distances))):
        rate = permitted_speed(distance, SETTINGS) / way
        np.testing.assert_allclose(found, np.minimum(rate[:-1], rate[1:]))


def test_the_bound_holds_between_samples_and_is_tight():
    """Against the ratio at each tenth of a millisecond, with a tube that comes, grows and ends."""
    goal = ARM.forward_kinematics(PATH.spline(1.0))[:3, 3]
    times_s = np.arange(0.0, PLAN.duration_s, 1e-4)
    q, velocity, _ = PLAN.sampled(times_s)
    points, speeds = ARM.moving_skeleton(q, velocity)
    decided = set()
    for away in np.linspace(0.5, 3.0, 21):
        who = PredictedPerson(
            np.array([100, 700, 1500]) * 1_000_000,
            goal + np.outer([away, 0.8 * away, 0.6 * away], [1.0, 0.0, 0.0]),
            np.array([0.01, 0.05, 0.05]),
        )
        distance = SEPARATION.distance_m(points, times_s * 1e9, who)
        true = float((speeds.max(axis=1) / permitted_speed(distance, SETTINGS)).max())
        bound = SEPARATION.excess(PLAN, 0, who)
        assert (bound > 1.0) == (true > 1.0)
        assert bound > 1.0 or bound >= true
        decided.add(bound > 1.0)
    assert decided == {False, True}


def test_the_bound_of_a_slow_plan_is_that_of_its_fastest_instant():
    """Between two samples the speed is theirs, but for the square of the time between them."""
    near = person(ARM.forward_kinematics(PATH.spline(0.5))[:3, 3] + [0.0, 0.0, 0.3])
    plan = PLAN
    for _ in range(3):
        ceiling = SEPARATION.rate_ceiling(PATH, phase_times_ns(plan, 0), near, ON_PATH)
        plan = plan_along(PATH, 0.93 * ceiling)
    times_s = np.arange(0.0, plan.duration_s, 1e-3)
    points, speeds = ARM.moving_skeleton(*plan.sampled(times_s)[:2])
    permitted = permitted_speed(SEPARATION.distance_m(points, times_s * 1e9, near), SETTINGS)
    true = float((speeds.max(axis=1) / permitted).max())
    assert true - 1e-9 <= SEPARATION.excess(plan, 0, near) <= 1.01 * true <= 1.01

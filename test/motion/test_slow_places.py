# SPDX-License-Identifier: Apache-2.0
"""The hand is slow at places, and the path is what it was."""

import numpy as np
import pytest
from activation_world import LIMITS
from clearance_world import ARM, hand_of, plan_along

from intent_recognition.errors import ArgumentError
from intent_recognition.motion import SlowPlaces, make_path, parse_places
from intent_recognition.motion.plan import STEP_S
from intent_recognition.motion.retiming import N_GRID
from sim_bridge.scenarios.toolbox import HOME

SPEED_M_S, WAY_M = 0.1, 0.5


def turn_of(duration_s):
    """A path on which the base joint turns evenly."""
    turn = np.array([0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    ends = np.stack([HOME - 0.5 * turn, HOME, HOME + 0.5 * turn])
    return make_path(duration_s * np.array([0.0, 0.5, 1.0]), ends, LIMITS)


@pytest.mark.parametrize(("phase", "radius_m"), [(0.5, 0.03), (0.505, 0.002)])
def test_the_hand_keeps_the_speed_at_a_place_and_is_as_fast_as_before_elsewhere(phase, radius_m):
    """The smaller one is between two points of the path's grid."""
    path = turn_of(1.0)
    place_m = ARM.forward_kinematics(path.spline(phase))[:3, 3]
    places = SlowPlaces(
        ARM, parse_places([f"{' '.join(map(str, place_m))} {radius_m} {SPEED_M_S}"])
    )
    plans = [plan_along(path, ceiling) for ceiling in (None, places.rate_ceiling(path))]
    speeds = []
    for plan in plans:
        hand, speed = hand_of(plan)
        at_place = np.linalg.norm(hand - place_m, axis=1) < radius_m
        slow_way = np.sum(speed[speed < 1.2 * SPEED_M_S]) * 1e-3
        speeds.append((speed[at_place].max(), speed[~at_place].max(), slow_way))
    (free, fastest, at_ends), (slow, elsewhere, slow_way) = speeds
    assert free > 3.0 * SPEED_M_S
    assert slow < 1.01 * SPEED_M_S
    assert slow_way - at_ends < 2.0 * radius_m + WAY_M / N_GRID * 2.0
    assert elsewhere > 0.7 * fastest
    assert plans[0].end == pytest.approx(plans[1].end)


@pytest.mark.parametrize("duration_s", [4.0, 10.0])
def test_the_hand_keeps_a_low_speed_at_a_place_between_the_samples_of_a_long_plan(duration_s):
    path = turn_of(duration_s)
    place_m = ARM.forward_kinematics(path.spline(0.587))[:3, 3]
    places = SlowPlaces(ARM, np.array([[*place_m, 0.06, 0.1 * WAY_M / duration_s]]))
    plan = plan_along(path, places.rate_ceiling(path))
    assert plan.times_s[1] > 2.0 * STEP_S
    assert places.excess(plan) < 1.01


@pytest.mark.parametrize(
    "text", ["0 0 0 0.1", "0 0 0 0 0.1", "0 0 0 0.1 -1", "a b c d e", "0 0 nan 1 1"]
)
def test_what_is_no_place_is_refused(text):
    with pytest.raises(ArgumentError, match="slow_at"):
        parse_places([text])
    assert parse_places([""]).shape == (0, 5)

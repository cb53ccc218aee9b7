# SPDX-License-Identifier: Apache-2.0
"""How a person pours, and what is recorded of it; no physics."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from experiments.pouring.person import SAMPLE_S, draw_habit, plan_pour
from experiments.pouring.pour import Poured
from experiments.pouring.recordings import (
    CUP,
    SECOND,
    DemonstrationOrder,
    metadata,
    true_references,
)
from intent_recognition.warping import References, to_warped
from sim_bridge.containers.generate import make_container
from sim_bridge.scenarios.pouring.novel import pour_of
from sim_bridge.scenarios.pouring.task_space import SideGrasp, plan_joints

SMALL = References(0.043, 4.5e-4, 0.095, 0.8)
BOWL = References(0.069, 5.8e-4, 0.066, 0.34)


def poured(order):
    """A demonstration whose arm follows the plan exactly."""
    cup, second = make_container(CUP, 1), make_container(SECOND, 1)
    path = plan_pour(draw_habit(order.rng()), true_references(cup), true_references(second))
    joints = plan_joints(path, SideGrasp(cup.lip_point, cup.height_m))
    times = np.arange(0.0, path.times_s[-1], 0.01)
    q, none = joints(times), np.zeros((len(times), 7))
    counts = np.zeros(len(times), dtype=int)
    return path, Poured(
        times, q, joints(times, 1), none, path, counts, counts, 40, 0, 8.0, 0, 0.0, 0.0
    )


def test_joints_tell_the_pour():
    order = DemonstrationOrder(1, 0)
    path, made = poured(order)
    told = metadata(order, made)
    back = pour_of(made.times_s, made.joints_rad, told)
    for axis in range(3):
        asked = np.interp(made.times_s, path.times_s, path.offset_m[:, axis])
        assert np.abs(back.offset_m[:, axis] - asked).max() < 2e-3
    asked = np.interp(made.times_s, path.times_s, path.tilt_rad)
    assert np.degrees(np.abs(back.tilt_rad - asked).max()) < 1.0
    assert told["spilled"] == "40"


@given(st.integers(0, 1000))
def test_from_rest_to_rest_and_over_the_opening_while_pouring(seed):
    habit = draw_habit(np.random.default_rng(seed))
    path = plan_pour(habit, SMALL, BOWL)
    warped = to_warped(path.offset_m, path.tilt_rad, SMALL, BOWL)
    np.testing.assert_allclose(warped[0], habit.start, atol=1e-9)
    assert path.tilt_rad.max() == np.clip(path.tilt_rad.max(), 1.9, 2.8)
    pouring = warped[:, 3] > 1.2
    assert np.all(np.hypot(warped[pouring, 0], warped[pouring, 1])[:-1] < 3.0)
    first = np.argmax(pouring)
    assert np.hypot(*warped[first, :2]) < 1.0
    step = np.abs(np.diff(path.offset_m, axis=0)).max(axis=1) / SAMPLE_S
    assert step[0] < 0.02
    assert step[-1] < 0.02
    assert abs(path.times_s[-1] - habit.duration_s) < 1e-9

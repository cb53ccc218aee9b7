# SPDX-License-Identifier: Apache-2.0
"""A recorded pour says where the lip was; no physics."""

import numpy as np

from experiments.pouring.person import draw_habit, plan_pour
from experiments.pouring.pour import Poured
from experiments.pouring.recordings import (
    CUP,
    SECOND,
    DemonstrationOrder,
    metadata,
    true_references,
)
from sim_bridge.containers.generate import make_container
from sim_bridge.scenarios.pouring.novel import pour_of
from sim_bridge.scenarios.pouring.task_space import SideGrasp, plan_joints


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

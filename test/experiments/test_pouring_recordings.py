# SPDX-License-Identifier: Apache-2.0
"""A recorded pour says where the lip was; no physics."""

import numpy as np

from experiments.pouring.person import draw_habit, plan_pour
from experiments.pouring.pour import Poured
from experiments.pouring.recordings import (
    CUP,
    SECOND,
    DemonstrationOrder,
    messages,
    metadata,
    orders,
    true_references,
)
from sim_bridge.containers.generate import make_container
from sim_bridge.scenarios.pouring.novel import pour_of
from sim_bridge.scenarios.pouring.pairs import half_full_radius_m
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


def test_messages_are_in_order_and_the_same_every_time():
    order = DemonstrationOrder(1, 3)
    _, made = poured(order)
    first, again = list(messages(order, made)), list(messages(order, made))
    stamps = [stamp for _, _, stamp, _ in first]
    assert stamps[0] == order.start_ns
    assert set(np.diff(stamps)) == {10_000_000}
    np.testing.assert_array_equal(first[5][3]["position"], again[5][3]["position"])
    assert np.abs(first[5][3]["position"] - made.joints_rad[5]).max() < 1e-3


def test_ten_demonstrations_of_a_half_full_cup():
    assert len({order.folder for order in orders(1)}) == 10
    cup = make_container(CUP, 1)
    balls = 40 * 4.0 / 3.0 * np.pi * half_full_radius_m(cup) ** 3
    assert np.isclose(balls, 0.6 * 0.5 * cup.inner_volume_m3)

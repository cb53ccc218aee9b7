# SPDX-License-Identifier: Apache-2.0
"""Reaches that are changed on the way: where they go, and that nothing jumps."""

import numpy as np
import pytest

from experiments.change_of_mind.changes import APART_M, change_of_mind, depart, draw_elsewhere
from sim_bridge.coworker import STYLES, TASKS, Reach, draw_reach, draw_rest, last_reach

SHARES, BLENDS = (0.15, 0.25, 0.4, 0.6), (0.15, 0.25, 0.4, None)
STEP_S = 1e-3


def drawn(seed, share, blend, task=TASKS[1]):
    rng = np.random.default_rng(seed)
    first = draw_reach(rng, TASKS[0], draw_rest(rng))
    return first, change_of_mind(rng, first, task, share, blend)


@pytest.mark.parametrize("blend", BLENDS)
@pytest.mark.parametrize("share", SHARES)
def test_a_changed_reach_goes_from_the_first_to_the_second_goal_without_a_jump(share, blend):
    for seed in range(5):
        first, changed = drawn(seed, share, blend)
        before = np.linspace(0.0, changed.change_s, 50)
        np.testing.assert_allclose(
            changed.positions(before), first.positions(before), rtol=0, atol=1e-12
        )
        end = changed.positions(np.array([changed.duration_s, changed.duration_s + 1.0]))
        np.testing.assert_allclose(end, [changed.second.goal_m] * 2, atol=1e-12)
        assert changed.task == changed.second.task == TASKS[1]
        assert changed.change_s == pytest.approx(share * first.duration_s)
    for seed in range(5):
        _, changed = drawn(seed, share, blend)
        at = changed.change_s + STEP_S * np.arange(-3.0, 4.0)
        x = changed.positions(at)
        velocity = np.diff(x, axis=0) / STEP_S
        acceleration = np.diff(velocity, axis=0) / STEP_S
        assert np.abs(np.diff(velocity, axis=0)).max() < 0.01  # m/s within a millisecond
        assert np.abs(acceleration[-1] - acceleration[0]).max() < 1.0  # m/s^2, of up to 10


def test_a_blend_reaches_the_second_course_and_turns_the_wrist_without_a_jump():
    _, changed = drawn(3, 0.25, 0.25)
    after = np.linspace(0.5 * changed.duration_s + 1e-6, changed.duration_s, 50)
    np.testing.assert_allclose(changed.positions(after), changed.second.positions(after))
    assert changed.duration_s == changed.first.duration_s
    for blend in BLENDS:
        _, changed = drawn(6, 0.25, blend)
        turned = changed.rotations(np.linspace(0.0, changed.duration_s, 2000), np.zeros(3))
        assert np.abs(np.diff(turned, axis=0)).max() < 0.01
        np.testing.assert_allclose(turned[-1], last_reach(changed).turn_rad, atol=1e-12)


def test_a_replanned_straight_reach_is_the_fifth_order_polynomial_of_its_ends():
    first = Reach("", np.zeros(3), np.array([0.4, 0, 0]), 2.0, np.zeros(3), 1.0, np.zeros(3))
    tau = 0.4  # of minimum jerk from 0 to 0.4 m in 2 s: its state by its own derivatives
    s = 10 * tau**3 - 15 * tau**4 + 6 * tau**5
    v = (30 * tau**2 - 60 * tau**3 + 30 * tau**4) / 2.0
    a = (60 * tau - 180 * tau**2 + 120 * tau**3) / 4.0
    state = [0.4 * np.array([value, 0, 0]) for value in (s, v, a)]
    reach = Reach("", state[0], np.array([0.2, 0.1, 0]), 1.2, np.zeros(3), 1.0, np.zeros(3))
    second = depart(reach, *state[1:])
    times = np.linspace(0.0, 1.2, 7)
    rows = np.array(
        [[t**k for k in range(6)] for t in (0.0, 1.2)]
        + [[k * t ** max(k - 1, 0) for k in range(6)] for t in (0.0, 1.2)]
        + [[k * (k - 1) * t ** max(k - 2, 0) for k in range(6)] for t in (0.0, 1.2)]
    )
    ends = np.array([state[0], second.goal_m, state[1], np.zeros(3), state[2], np.zeros(3)])
    polynomial = np.vander(times, 6, increasing=True) @ np.linalg.solve(rows, ends)
    np.testing.assert_allclose(second.positions(times), polynomial, atol=1e-12)
    at = np.array([0.8 - STEP_S, 0.8, 0.8 + STEP_S])
    np.testing.assert_allclose(
        np.diff(first.positions(at), axis=0).sum(axis=0) / (2 * STEP_S), state[1], atol=1e-5
    )


def test_a_movement_to_no_task_ends_far_from_every_goal():
    rng = np.random.default_rng(5)
    for _ in range(200):
        goal = draw_elsewhere(rng, draw_rest(rng), 2.0).goal_m
        for style in STYLES.values():
            nearest = np.clip(
                goal,
                style.goal_centre_m - style.goal_half_width_m,
                style.goal_centre_m + style.goal_half_width_m,
            )
            assert np.linalg.norm(goal - nearest) >= APART_M
    _, changed = drawn(7, 0.4, 0.25, task="")
    assert changed.task == ""

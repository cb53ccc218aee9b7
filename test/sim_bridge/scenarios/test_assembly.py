# SPDX-License-Identifier: Apache-2.0
"""Two coworkers who assemble a box: mutual timing, places, recordings, the arm's reach."""

from itertools import pairwise

import numpy as np
import pytest

from experiments.assembly.arm_stand_in import hand_joints
from experiments.assembly.recordings import orders
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.kinematics.limits import within_position_limits
from intent_recognition.kinematics.lwr import LWR_LIMITS, hand_position
from intent_recognition.share import share_path
from sim_bridge.scenarios.assembly import ASSISTANT, FASTENING, HAND_OVER, PERSONAL_STD_M, WORKER
from sim_bridge.scenarios.assembly.interaction import plan_interaction
from sim_bridge.scenarios.assembly.session import PER_TASK, SESSIONS, plan_session
from sim_bridge.scenarios.assembly.styles import (
    FLIPPED_M,
    GIVE_M,
    GRASP_S,
    HOLD_M,
    PLATE_INSERTION,
    REACTION_S,
    READY_S,
    RESTS,
    TASKS,
)

OFFSETS = {HAND_OVER: GIVE_M, FASTENING: HOLD_M, PLATE_INSERTION: FLIPPED_M}


def draws(task, count=60):
    rng = np.random.default_rng(5)
    return [
        plan_interaction(rng, task, RESTS[WORKER].draw(rng), RESTS[ASSISTANT].draw(rng), 1.0)
        for _ in range(count)
    ]


def end(timed):
    onset, reach = timed
    return onset + reach.duration_s


@pytest.mark.parametrize("task", TASKS)
def test_movements_are_strung_together_and_people_react_to_and_wait_for_one_another(task):
    for shown in draws(task):
        for moved in (shown.worker, shown.assistant):
            for before, after in pairwise(moved):
                assert after[0] >= end(before)
                np.testing.assert_array_equal(after[1].start_m, before[1].goal_m)
        cause_s = shown.onset_s if task == HAND_OVER else end(shown.worker[0])
        assert REACTION_S[0] <= shown.assistant[0][0] - cause_s <= REACTION_S[1]
        if task == HAND_OVER:
            pause = shown.assistant[1][0] - end(shown.assistant[0])
            assert GRASP_S[0] - 1e-9 <= pause <= GRASP_S[1] + 1e-9
        else:
            wait = shown.worker[-1][0] - max(shown.arrival_s, end(shown.worker[-2]))
            assert READY_S[0] - 1e-9 <= wait <= READY_S[1] + 1e-9
            assert shown.end_s == pytest.approx(end(shown.worker[-1]))


@pytest.mark.parametrize("task", TASKS)
def test_assistants_goal_is_the_workers_but_for_the_person(task):
    off = np.array([s.assistant[-1][1].goal_m - s.goal_m - OFFSETS[task] for s in draws(task, 300)])
    assert np.abs(off.mean(axis=0)).max() < 4 * PERSONAL_STD_M / np.sqrt(len(off))
    np.testing.assert_allclose(off.std(axis=0), PERSONAL_STD_M, rtol=0.2)


def test_fastening_ends_where_a_hand_over_ends():
    ends = {t: np.array([s.worker[-1][1].goal_m for s in draws(t, 200)]) for t in TASKS}
    off = ends[FASTENING] - ends[HAND_OVER].mean(axis=0)
    covariance = np.cov(ends[HAND_OVER].T)
    inside = np.einsum("ni,ni->n", off @ np.linalg.inv(covariance), off) <= 7.815
    assert inside.mean() > 0.9


@pytest.mark.slow
def test_arm_reaches_wherever_an_assistant_goes():
    for task in TASKS:
        for shown in draws(task, 40):
            for _, reach in shown.assistant:
                path = reach.positions(np.linspace(0.0, reach.duration_s, 15))
                joints = hand_joints(path)
                np.testing.assert_allclose(hand_position(joints), path, atol=1e-9)
                assert np.all(within_position_limits(joints, LWR_LIMITS))
                assert np.abs(np.diff(joints, axis=0)).max() < 0.6  # no flip of a branch


@pytest.mark.slow
def test_shipped_recordings_hold_two_wrists_forty_times_each_task():
    dofs = load_dofs(share_path("config/dofs_two_humans.yaml"))
    demonstrations, rejections = read_demonstrations(share_path("bags/assembly"), dofs)
    assert rejections == []
    assert len(orders(1)) == SESSIONS
    tasks = [d.task for d in demonstrations]
    assert {task: tasks.count(task) for task in TASKS} == dict.fromkeys(TASKS, PER_TASK)
    names = demonstrations[0].controlled[0].names
    assert names == tuple(f"mocap/assistant/pose.pose.position.{axis}" for axis in "xyz")
    plan = plan_session(1, 0)
    first = demonstrations[0].observed[0]
    at = np.round((first.stamps_ns - first.stamps_ns[0]) * 1e-7).astype(int)
    begin = round((plan.interactions[0].onset_s - 0.4) * 100)
    shift = [
        np.abs(plan.worker.true_positions_m[at + begin + k] - first.values).max() for k in (0, 1)
    ]
    assert min(shift) < 0.01

# SPDX-License-Identifier: Apache-2.0
"""The session is a pure function: order, timing, and nothing else than what was asked for."""

from collections import Counter

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from sim_bridge.coworker.session import SessionTiming, plan_session
from sim_bridge.coworker.styles import TASKS
from sim_bridge.coworker.task_list import parse_task_list


def test_same_seed_gives_the_same_session_and_another_seed_another():
    tasks = parse_task_list("random", 3, 6)
    one, two, other = plan_session(3, tasks), plan_session(3, tasks), plan_session(4, tasks)
    assert one.samples.positions_m.tobytes() == two.samples.positions_m.tobytes()
    assert one.samples.visible.tobytes() == two.samples.visible.tobytes()
    assert one.samples.positions_m[:50].tobytes() != other.samples.positions_m[:50].tobytes()


def test_forty_interactions_are_balanced_and_in_random_order():
    tasks = parse_task_list("random", 1, 0)
    assert sorted(Counter(tasks).values()) == [13, 13, 14]
    assert tasks != parse_task_list("random", 2, 0)
    assert tuple(sorted(tasks)) != tasks


def test_rests_holds_and_movements_follow_one_another():
    plan = plan_session(7, parse_task_list("random", 7, 12))
    previous_end = 0.0
    for interaction in plan.interactions:
        duration = interaction.end_s - interaction.onset_s
        assert 1.6 <= duration <= 4.8
        assert interaction.onset_s - previous_end >= (2.0 if previous_end == 0.0 else 3.8)
        previous_end = interaction.end_s
        at = np.searchsorted(plan.samples.times_s, interaction.end_s + 0.5)
        wrist = plan.samples.true_positions_m[at]
        assert np.linalg.norm(wrist - interaction.goal_m) < 0.01
        before = np.searchsorted(plan.samples.times_s, interaction.onset_s - 0.3)
        start = interaction.reach.positions(np.zeros(1))[0]
        assert np.linalg.norm(plan.samples.true_positions_m[before] - start) < 0.01


def test_the_wrist_never_jumps_and_some_samples_are_occluded():
    plan = plan_session(2, parse_task_list("random", 2, 20))
    speed = np.linalg.norm(np.diff(plan.samples.positions_m, axis=0), axis=1) * 100.0
    assert speed.max() < 2.0
    assert 0.97 < plan.samples.visible.mean() < 1.0
    np.testing.assert_allclose(plan.samples.times_s, np.arange(len(speed) + 1) * 0.01)


def test_timing_is_respected():
    timing = SessionTiming(0.7, (0.5, 0.5), (0.2, 0.2), 0.3, 0.0)
    plan = plan_session(1, [TASKS[0]], timing)
    assert plan.interactions[0].onset_s == 0.7
    assert plan.samples.visible.mean() > 0.99


def test_task_lists(tmp_path):
    text = tmp_path / "list.txt"
    text.write_text("plate_handover\nscrew_handover\n")
    file = tmp_path / "list.yaml"
    file.write_text("tasks: [hold_screwdriver, plate_handover]\n")
    assert parse_task_list(str(text), 1, 0) == ("plate_handover", "screw_handover")
    assert parse_task_list(str(file), 1, 3) == (
        "hold_screwdriver", "plate_handover", "hold_screwdriver"
    )  # fmt: skip
    assert parse_task_list(" plate_handover , screw_handover", 1, 0) == TASKS[:2]


@pytest.mark.parametrize("bad", ["", "dance", "plate_handover,dance", "/no/such/file.yaml"])
def test_bad_task_lists_are_named(bad):
    with pytest.raises(ArgumentError, match="task_list"):
        parse_task_list(bad, 1, 0)


def test_other_bad_arguments_are_named():
    with pytest.raises(ArgumentError, match="interactions"):
        parse_task_list("random", 1, -1)
    with pytest.raises(ArgumentError, match="label"):
        plan_session(1, [])

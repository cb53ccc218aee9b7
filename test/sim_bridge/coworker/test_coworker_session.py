# SPDX-License-Identifier: Apache-2.0
"""Sessions follow from seed and tasks alone: order, timing, habit, and the work of a plan."""

import hashlib
from collections import Counter

import numpy as np
import pytest
from bag_builder import messages_in

from experiments.teaching.record_sessions import FIRST_SEED, INTERACTIONS, SESSIONS, record_session
from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import read_task_sequences
from intent_recognition.errors import ArgumentError
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions
from intent_recognition.plans import WorkProgress, read_plan
from intent_recognition.share import share_path
from sim_bridge.coworker import change_some, draw_reach, work_shares
from sim_bridge.coworker.session import WITHOUT_PAUSE, SessionTiming, plan_people, plan_session
from sim_bridge.coworker.styles import HOLD, PLATE, STYLES, TASKS
from sim_bridge.coworker.task_list import (
    CHANGE_SHARES,
    FIRST,
    FOLLOWS,
    Intention,
    habitual_tasks,
    parse_task_list,
    read_intention,
)


def test_task_lists_of_entries_that_are_labels_or_changes_in_random_order(tmp_path):
    text = tmp_path / "list.txt"
    text.write_text("plate_handover\nscrew_handover\n")
    file = tmp_path / "list.yaml"
    file.write_text("tasks: [hold_screwdriver, plate_handover]\n")
    assert parse_task_list(str(text), 1, 0) == ("plate_handover", "screw_handover")
    assert parse_task_list(str(file), 1, 3) == (
        "hold_screwdriver", "plate_handover", "hold_screwdriver"
    )  # fmt: skip
    assert parse_task_list(" plate_handover , screw_handover", 1, 0) == TASKS[:2]
    assert read_intention(PLATE) == Intention(PLATE)
    assert read_intention(CHANGED) == Intention(PLATE, HOLD, 0.25)
    assert parse_task_list(f"{PLATE}, {CHANGED}", 1, 3) == (PLATE, CHANGED, PLATE)
    tasks = parse_task_list("random", 1, 0)
    assert sorted(Counter(tasks).values()) == [13, 13, 14]
    assert tasks != parse_task_list("random", 2, 0)
    assert tuple(sorted(tasks)) != tasks


def test_rests_holds_and_movements_follow_one_another_without_a_jump():
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
    plan = plan_session(2, parse_task_list("random", 2, 20))
    speed = np.linalg.norm(np.diff(plan.samples.positions_m, axis=0), axis=1) * 100.0
    assert speed.max() < 2.0
    assert 0.97 < plan.samples.visible.mean() < 1.0
    np.testing.assert_allclose(plan.samples.times_s, np.arange(len(speed) + 1) * 0.01)
    timing = SessionTiming(0.7, (0.5, 0.5), (0.2, 0.2), 0.3, 0.0)
    plan = plan_session(1, [TASKS[0]], timing)
    assert plan.interactions[0].onset_s == 0.7
    assert plan.samples.visible.mean() > 0.99


@pytest.mark.parametrize("seed", range(1, 4))
def test_hands_of_two_people_are_never_in_one_place(seed):
    tasks = [parse_task_list("random", own, 10) for own in (seed, seed + 50)]
    wrists_m = [plan.samples.true_positions_m for plan in plan_people(seed, tasks)]
    n = min(map(len, wrists_m))
    apart_m = np.linalg.norm(wrists_m[0][:n] - wrists_m[1][:n], axis=1)
    assert apart_m.min() > 0.08  # a hand's width


@pytest.mark.parametrize("task", ["hold_screwdriver", "plate_handover>hold_screwdriver@0.25"])
def test_each_of_two_reaches_on_their_own_side(task):
    middle_m = STYLES["hold_screwdriver"].goal_centre_m[1]
    for seed in range(20):
        goals_m = [plan.interactions[0].goal_m[1] for plan in plan_people(seed, [[task], [task]])]
        assert goals_m[0] > middle_m > goals_m[1]


@pytest.mark.parametrize(
    "bad", ["", "dance", "plate_handover,dance", "/no/such/file.yaml", f"rest>{PLATE}@0.25"]
)
def test_bad_task_lists_are_named(bad):
    with pytest.raises(ArgumentError, match=r"task_list: .* a file of them, .*(neither|got '')"):
        parse_task_list(bad, 1, 0)


CHANGED = f"{PLATE}>{HOLD}@0.25"


@pytest.mark.parametrize(
    "bad",
    [
        f"{PLATE}>{PLATE}@0.2",
        f"{PLATE}>{HOLD}@1.0",
        f"{PLATE}>{HOLD}@soon",
        f"{PLATE}>{HOLD}",
        f"{PLATE}@0.2",
        f"{PLATE}>dance@0.2",
        f"{PLATE}>{HOLD}@nan",
    ],
)
def test_other_entries_are_refused_in_one_line(bad):
    with pytest.raises(ArgumentError, match="task_list") as error:
        parse_task_list(bad, 1, 0)
    assert "\n" not in str(error.value)


def test_the_session_says_what_was_changed_and_when():
    plan = plan_session(4, [PLATE, CHANGED, HOLD])
    plain, changed, after = plan.interactions
    assert (plain.changed_from, plain.task) == ("", PLATE) and np.isnan(plain.change_s)
    assert (changed.changed_from, changed.task) == (PLATE, HOLD)
    share = (changed.change_s - changed.onset_s) / (changed.end_s - changed.onset_s)
    assert share == pytest.approx(0.25)
    assert after.task == HOLD
    at = np.searchsorted(plan.samples.times_s, changed.end_s + 0.5)
    assert np.linalg.norm(plan.samples.true_positions_m[at] - changed.goal_m) < 0.01


def test_as_many_entries_are_changed_as_asked_for():
    tasks = parse_task_list("habit", 1, 40)
    some = change_some(tasks, 1, 10)
    assert some == change_some(tasks, 1, 10) != change_some(tasks, 2, 10)
    changed = [(a, read_intention(b)) for a, b in zip(tasks, some, strict=True) if a != b]
    assert len(changed) == 10
    for task, intention in changed:
        assert intention.task == task and intention.then in set(TASKS) - {task}
        assert intention.share in CHANGE_SHARES
    assert change_some(tasks, 1, 0) == tasks
    with pytest.raises(ArgumentError, match="at most 40"):
        change_some(tasks, 1, 41)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: plan_session(1, ()), "tasks: expected at least one label"),
        (lambda: parse_task_list("habit", 1, -1), "interactions: expected 0 or more, got -1"),
        (lambda: draw_reach(np.random.default_rng(0), "sing", np.zeros(3)), "task: expected one"),
    ],
)
def test_what_a_coworker_cannot_do_is_refused(ask, said):
    with pytest.raises(ArgumentError, match=said):
        ask()


def test_without_a_pause_the_wrist_is_never_at_rest_between_the_first_and_the_last():
    plan = plan_session(5, parse_task_list("random", 5, 10), WITHOUT_PAUSE)
    onsets = np.array([i.onset_s for i in plan.interactions])
    ends = np.array([i.end_s for i in plan.interactions])
    assert np.all(onsets[1:] > ends[:-1]) and len(onsets) == 10
    times, wrist = plan.samples.times_s, plan.samples.true_positions_m
    assert np.linalg.norm(np.diff(wrist, axis=0), axis=1).max() < 0.02  # at 100 Hz: no jump
    window = 30  # 0.3 s, after which the estimator would call it a rest
    moved = np.linalg.norm(wrist[window:] - wrist[:-window], axis=1)
    working = (times[:-window] > onsets[0]) & (times[window:] < ends[-1])
    assert np.percentile(moved[working], 1) > 0.003
    for interaction in plan.interactions:
        at = np.searchsorted(times, interaction.end_s)
        assert np.linalg.norm(wrist[at] - interaction.goal_m) < 0.02


def test_the_habit_is_the_chain_it_says_and_that_of_shipped_sessions(repository):
    np.testing.assert_allclose(np.vstack([FOLLOWS, FIRST]).sum(axis=1), 1.0)
    sequences = [habitual_tasks(seed, 60) for seed in range(100)]
    counts = count_transitions(sequences, TASKS)
    shares = counts / counts.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(shares[:3], FOLLOWS, atol=0.03)
    np.testing.assert_allclose(shares[3], FIRST, atol=0.12)
    assert min(Counter(sequences[0]).values()) >= 10
    sequences, rejections = read_task_sequences([repository / "bags" / "sessions"], 60.0)
    assert rejections == [] and len(sequences) == SESSIONS
    for number, sequence in enumerate(sequences):
        assert sequence.tasks == habitual_tasks(FIRST_SEED + number, INTERACTIONS)
    prior = smoothed_transitions(count_transitions([s.tasks for s in sequences], TASKS))
    np.testing.assert_allclose(prior[:3], FOLLOWS, atol=0.1)


@pytest.mark.slow
def test_shipped_sessions_can_be_made_again(repository, tmp_path):
    shipped = repository / "bags" / "sessions"
    made = record_session(tmp_path, FIRST_SEED + 1, 1, INTERACTIONS)
    assert "task" not in BagReader(made).custom_data
    assert messages_in(made) == messages_in(shipped / made.name)
    listed = dict(
        reversed(line.split()) for line in (shipped / "SHA256SUMS").read_text().splitlines()
    )
    files = {
        str(path.relative_to(shipped)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in shipped.rglob("*")
        if path.is_file() and path.name != "SHA256SUMS"
    }
    assert files == listed


@pytest.fixture(scope="module")
def plan():
    return read_plan(share_path("config/examples/cell_plan.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("seed", range(20))
def test_every_order_is_allowed_and_does_all(plan, seed):
    (tasks,) = work_shares(plan, seed, 1)
    assert Counter(tasks) == Counter(step.task for step in plan.steps)
    done, times = set(), Counter()
    for task in tasks:
        times[task] += 1  # the k-th time that it is done is its k-th step
        names = [step.name for step in plan.steps if step.task == task]
        name = names[times[task] - 1]
        assert {a for (a, b) in plan.by_hand if b == name} <= done, (name, done)
        done.add(name)


def test_the_plan_has_twenty_steps_and_begins_with_a_plate(plan):
    assert len(plan.steps) == 20
    labels = ("plate_handover", "screw_handover", "hold_screwdriver")
    expected = WorkProgress(plan, labels).next_tasks()
    assert expected.argmax() == 0


@pytest.mark.parametrize("seed", range(5))
def test_two_people_do_at_any_time_what_may_be_next(plan, seed):
    shares = work_shares(plan, seed, 2)
    session = plan_people(seed, shares, SessionTiming(hold_s=(13.0, 14.0)))
    assert [len(one.interactions) for one in session] == [10, 10]
    everything = sorted((i.onset_s, i.end_s, i.task) for one in session for i in one.interactions)
    assert Counter(task for *_, task in everything) == Counter(step.task for step in plan.steps)
    ends: dict[str, float] = {}
    times: Counter[str] = Counter()
    for onset_s, end_s, task in everything:
        times[task] += 1  # the k-th time that it is begun is its k-th step
        name = [step.name for step in plan.steps if step.task == task][times[task] - 1]
        assert max([ends[a] for (a, b) in plan.by_hand if b == name], default=0.0) < onset_s
        ends[name] = end_s
    few = work_shares(plan, seed, 2, 3)
    assert [share[: len(own)] for share, own in zip(shares, few, strict=True)] == list(few)
    assert sum(len(own) - own.count("rest") for own in few) == 3

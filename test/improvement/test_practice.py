# SPDX-License-Identifier: Apache-2.0
"""Practice is kept rollout by rollout and goes on to the same result; costs are checked."""

import json
from pathlib import Path

import numpy as np
import pytest

from experiments.recording import JOINT_TOPIC, JOINT_TYPE, joint_fields, write_recording
from intent_recognition.bags import BagReader
from intent_recognition.errors import ArgumentError, ModelError, ResourceBusyError
from intent_recognition.improvement import (
    Cost,
    CovarianceSearch,
    PracticeSession,
    Rollout,
    SearchSpace,
    compare,
    load_cost,
)

MISSED = Cost("missed", lambda rollout: rollout.outcome["missed"])
ABOUT = {"task": "reach", "seed": 3}


class Reach:
    """A task without physics: how far the weights are from a goal, with noise."""

    costs, step = (), 1.0
    space = SearchSpace(np.zeros(4), np.eye(4)[:, :3])

    def keeps_limits(self, weights):
        return weights[0] < 1.5

    def rollout(self, weights, rng):
        missed = float(np.sum((weights - [1.0, -0.5, 0.0, 0.0]) ** 2) + 0.01 * rng.normal())
        return [Rollout(np.arange(2.0), np.zeros((2, 7)), {"missed": missed})]

    def check(self, weights, count):
        return [self.rollout(weights, np.random.default_rng(k))[0] for k in range(count)]

    def write(self, folder, rollouts, labels):
        fields = joint_fields(10**9, *np.zeros((3, 7)))
        write_recording(folder, labels, [(JOINT_TOPIC, JOINT_TYPE, 10**9, fields)])


def session(folder, cost=None, **about):
    cost = cost or MISSED
    return PracticeSession(folder, Reach(), CovarianceSearch(3, 3), cost, {**ABOUT, **about})


@pytest.mark.slow
def test_a_practice_that_was_killed_goes_on_to_the_same_result(tmp_path, monkeypatch):
    whole = session(tmp_path / "whole")
    for _ in range(16):
        whole.step()
    for number in range(16):  # a new process each time, ended before the cost is kept
        broken = session(tmp_path / "killed")
        if number % 3 == 0:
            with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
                patched.setattr("intent_recognition.improvement.session.write_text", _killed)
                broken.step()
            broken = session(tmp_path / "killed")
        assert len(broken.tried) == number
        broken.step()
    again = session(tmp_path / "killed")
    assert np.array_equal(again.points, whole.points)
    assert np.array_equal(again.costs, whole.costs)
    assert np.array_equal(again.settled(), whole.settled())
    found = compare(Reach(), MISSED, again.settled(), 4)
    assert found.after < 0.5 * found.before == 0.5 * found.outcome_before["missed"]
    assert whole.costs[-1] < 0.5 * whole.costs[0]
    for one in again.tried:
        labels = BagReader(tmp_path / "killed" / one.bag).custom_data
        assert float(labels["cost"]) == pytest.approx(one.cost, rel=1e-5)


def _killed(*_):
    raise KeyboardInterrupt


def test_another_practice_or_a_damaged_file_is_refused_by_name(tmp_path):
    session(tmp_path).step()
    with pytest.raises(ResourceBusyError, match=r"begun with seed 3\..*--output"):
        session(tmp_path, seed=4)
    state = tmp_path / "practice.json"
    state.write_text(state.read_text().replace('"cost"', '"price"'))
    with pytest.raises(ModelError, match=r"practice\.json"):
        session(tmp_path)
    state.write_text(json.dumps({"format": 99, "about": {}, "tried": []}))
    with pytest.raises(ResourceBusyError, match="the same practice"):
        session(tmp_path)


def test_a_disk_that_is_full_is_told_and_nothing_counts_as_tried(tmp_path):
    full = session(tmp_path)
    (tmp_path / "practice.part").symlink_to("/dev/full")
    with pytest.raises(ResourceBusyError, match=r"practice\.json.*no space left.*Free space"):
        full.step()
    assert full.tried == []


POUR = Rollout(
    np.arange(3.0),
    np.zeros((3, 7)),
    {"balls": 40.0, "caught": 30.0, "spilled": 6.0, "kept": 4.0, "wanted": 40.0},
)


def test_costs_by_name_and_of_a_file(tmp_path):
    assert load_cost("spilled")(POUR) == 6.0 + 10.0
    assert load_cost("level")(POUR) == 10.0
    path = tmp_path / "mine.py"
    path.write_text(
        "import math\nfrom os.path import join\n\ndef _double(x):\n    return 2 * x\n\n"
        "def slow(rollout):\n    return _double(rollout.times_s[-1])\n"
    )
    assert load_cost(str(path))(POUR) == 4.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def a(r): return 1.0\ndef b(r): return 2.0\n", "got a, b"),
        ("x = 1\n", "got none"),
        ("def a(r) return\n", "SyntaxError"),
    ],
)
def test_a_file_of_another_kind_is_refused(tmp_path, text, message):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(ArgumentError, match=message):
        load_cost(str(path))


def test_a_cost_that_is_not_there_is_refused(tmp_path):
    (tmp_path / "folder.py").mkdir()
    cases = {"missing.py": "no such file", "folder.py": "a folder", "nothing": "spilled, level"}
    for name, message in cases.items():
        with pytest.raises(ArgumentError, match=f"{name}.*{message}|{message}.*{name}"):
            load_cost(str(tmp_path / name))


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return None", "got None"),
        ("return float('nan')", "got nan"),
        ("return True", "got True"),
        ("return 'cheap'", "'cheap'"),
        ("return rollout.outcome['gold']", "KeyError: 'gold' .line 2 of .*mine.py"),
    ],
)
def test_what_a_cost_returns_is_checked_and_rollouts_are_kept(tmp_path, body, message):
    path = tmp_path / "mine.py"
    path.write_text(f"def mine(rollout):\n    {body}\n")
    with pytest.raises(ArgumentError, match=message):
        session(Path(tmp_path / "out"), load_cost(str(path))).step()
    assert not (tmp_path / "out" / "practice.json").exists()

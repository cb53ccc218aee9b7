# SPDX-License-Identifier: Apache-2.0
"""`intent improve`: practise, go on, accept, undo."""

import io
import json

import numpy as np
import pytest

from experiments.practice import study
from experiments.practice.experiment import run
from experiments.settings import Settings
from intent_recognition.cli import improve
from intent_recognition.cli.main import main
from intent_recognition.model import load_pouring_skill


@pytest.fixture(autouse=True)
def few_checks(monkeypatch):
    """One fresh rollout before and after is compared as five are."""
    monkeypatch.setattr(improve, "CHECKS", 1)
    monkeypatch.setattr(study, "N_CHECKS", 1)


def pretend_more(folder, count):
    """Tell a folder of practice that so many rollouts more were made."""
    state = json.loads((folder / "practice.json").read_text())
    one, rng = state["tried"][-1], np.random.default_rng(count)
    for _ in range(count):
        point = (0.5 * rng.standard_normal(len(one["point"]))).tolist()
        state["tried"].append({**one, "point": point, "cost": rng.random()})
    (folder / "practice.json").write_text(json.dumps(state))


@pytest.mark.slow
def test_practise_go_on_accept_and_undo(pouring_skill, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "practice"
    base = ["improve", "pouring", "--start", str(pouring_skill), "--output", str(folder)]
    assert main([*base, "--accept"]) == 1
    assert "Practise first" in capsys.readouterr().err
    numbers = tmp_path / "n.json"
    assert main([*base, "--rollouts", "1", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert main([*base, "--rollouts", "2", "--json", str(numbers)]) == 0
    assert "practise on: nothing is better yet" in capsys.readouterr().out
    told = json.loads(numbers.read_text())
    assert told["costs"][:1] == first["costs"] and len(told["costs"]) == 2
    assert set(told["checked"]) == {"start", "settled"}
    assert len(list((folder / "rollouts").iterdir())) == 2
    assert not (folder / "skill.npz").exists()
    assert main([*base, "--accept"]) == 1
    assert "Practise on" in capsys.readouterr().err
    pretend_more(folder, 12)
    assert main([*base, "--accept"]) == 0
    accepted, shown = load_pouring_skill(folder / "skill.npz"), load_pouring_skill(pouring_skill)
    assert np.array_equal(accepted.primitive.spread, shown.primitive.spread)
    assert accepted.far == shown.far
    assert main([*base, "--accept"]) == 0 and not (folder / "skill.before.npz").exists()
    pretend_more(folder, 24)
    assert main([*base, "--accept"]) == 0 and (folder / "skill.before.npz").exists()
    assert main([*base, "--undo"]) == 0 and (folder / "skill.npz").exists()
    assert main([*base, "--undo"]) == 0 and not (folder / "skill.npz").exists()
    assert main([*base, "--undo"]) == 1
    assert main([*base, "--cost", "level"]) == 1
    assert "begun with cost spilled" in capsys.readouterr().err

    monkeypatch.setattr("sys.stdin", io.StringIO("what\nd\nu\nq\n"))
    thumbs = [*base[:-1], str(tmp_path / "thumbs"), "--cost", "thumbs"]
    assert main(thumbs) == 130
    state = json.loads((tmp_path / "thumbs" / "practice.json").read_text())
    assert [one["cost"] for one in state["tried"]] == [1.0, 0.0]


@pytest.mark.slow
def test_the_experiment_compares_both_searches_from_the_same_start():
    outcome = run(Settings(quick=True))
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    cma, random = numbers["CMA-ES"][0], numbers["random search"][0]
    assert cma["costs"][0] == random["costs"][0] and cma["start"] == random["start"] > 10.0
    assert len(outcome.blocks) == 1 and all(one.remark for one in outcome.findings)


def test_a_task_that_the_model_has_not_begins_no_library(toolbox_model, tmp_path, capsys):
    folder = tmp_path / "tasks"
    words = ("--library", str(folder), "--model", str(toolbox_model))
    assert main(["improve", "juggling", *words]) == 1
    assert "TASK: expected one of hold_screwdriver, " in capsys.readouterr().err
    assert not folder.exists()

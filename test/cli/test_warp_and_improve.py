# SPDX-License-Identifier: Apache-2.0
"""`intent warp` and `intent improve`: meshes whose truth is known; practise, accept, undo."""

import io
import json

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from experiments.practice import study
from experiments.practice.experiment import run
from experiments.settings import Settings
from intent_recognition.cli import improve
from intent_recognition.cli.main import main
from intent_recognition.model import load_pouring_skill
from sim_bridge.containers.generate import make_container


@pytest.fixture
def bowl(tmp_path):
    """A bowl and the file of its mesh."""
    container = make_container("round_bowl", 2)
    path = tmp_path / "bowl.stl"
    container.mesh.export(path)
    return container, path


@pytest.mark.slow
def test_json_is_near_the_truth(bowl, capsys):
    """Metres, cubic metres and radians; both mappings."""
    container, path = bowl
    for options in (["--grasp"], ["--grasp", "--mapping", "point"]):
        assert main(["warp", "mug", str(path), "--json", "--toward", "1", "0", "0", *options]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["volume_m3"] == pytest.approx(container.inner_volume_m3, rel=0.05)
        assert found["opening_radius_m"] == pytest.approx(container.opening_radius_m, rel=0.02)
        assert found["tilt_reference_rad"] == pytest.approx(container.tilt_reference_rad, abs=0.04)
        np.testing.assert_allclose(found["up"], [0.0, 0.0, 1.0], atol=0.03)
        assert not found["has_handle"]
        grasp = found["grasp"]
        turn = Rotation.from_quat(grasp["orientation"]).as_matrix()
        np.testing.assert_allclose(turn[:, 1:].T, [grasp["closing"], grasp["approach"]])
        distance = np.linalg.norm(grasp["position"][:2])
        assert distance == pytest.approx(container.opening_radius_m, rel=0.06)


@pytest.mark.slow
def test_a_table_and_a_report(bowl, tmp_path, capsys):
    """The page holds both figures and needs no network."""
    report = tmp_path / "page.html"
    assert main(["warp", "mug", str(bowl[1]), "--grasp", "--report", str(report)]) == 0
    shown = capsys.readouterr().out
    assert "grasp: width" in shown
    assert "tilt that leaves half" in shown
    assert str(report.name) in shown
    page = report.read_text(encoding="utf-8")
    assert page.count("<img") == 2
    assert "http://" not in page.replace("http://www.w3.org", "")


@pytest.mark.slow
def test_failures_are_one_line(bowl, tmp_path, capsys):
    """Source, target, scale and a closed top."""
    closed = tmp_path / "closed.ply"
    trimesh.creation.cylinder(radius=0.04, height=0.1).export(closed)
    for arguments, reason in (
        (["bucket", str(bowl[1])], "one of mug"),
        (["mug", str(tmp_path / "none.obj")], "none.obj"),
        (["mug", str(bowl[1]), "--scale", "1000"], "millimetres"),
        (["mug", str(closed)], "closed on top"),
    ):
        assert main(["warp", *arguments]) == 1
        error = capsys.readouterr().err
        assert reason in error
        assert error.count("\n") == 1


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

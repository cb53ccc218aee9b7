# SPDX-License-Identifier: Apache-2.0
"""`--json [OUT]` means the same in every command."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cli import experiment_stub
from cli.recorded import DOFS, TRUTH, write_all
from model_builder import learned_model, perform, write_recording

from experiments import catalogue
from experiments.catalogue import Experiment
from experiments.runs import ExperimentRun
from intent_recognition.cli import main as cli
from intent_recognition.cli.output import PRINTED, write_json
from intent_recognition.evaluation.reactive import REACTIVE_NAMES
from intent_recognition.learning import TrainingReport, TrainingSettings, learn_with_report
from intent_recognition.model import Model, save_model
from intent_recognition.report.evaluation_report import ONLINE_COLUMNS
from sim_bridge.containers.generate import make_container

TRAIN = ("train", "bags", "--dofs", "dofs.yaml", "--basis", "8")
COMMANDS = {
    "demo": (),  # as long as the demo: test_demo_arms
    "train": (*TRAIN, "--output", "NEW.npz"),
    "evaluate": ("evaluate", "bags", "--dofs", "dofs.yaml", "--protocol", "kfold:2"),
    "replay": ("replay", "bag", "--model", "model.npz"),
    "explain": ("explain", "bag", "--model", "model.npz"),
    "rehearse": (),  # times of computation differ from run to run: test_replay
    "inspect": ("inspect", "bag"),
    "recover": ("recover", "bag", "--output", "NEW"),
    "segment": ("segment", "bag", "--model", "model.npz", "--output", "NEW"),
    "warp": ("warp", "mug", "bowl.stl"),
    "experiments": ("experiments", "stub", "--output", "NEW"),
    "improve": (),  # a rollout takes seconds: test_warp_and_improve
}
MORE = (("inspect", "bags"), ("inspect", "model.npz"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """What the commands read."""
    path = tmp_path_factory.mktemp("json")
    write_all(path)
    write_recording(path / "bag", perform(TRUTH, 1, 50), DOFS)
    save_model(path / "model.npz", learned_model(DOFS, TRUTH, per_task=4))
    make_container("round_bowl", 2).mesh.export(path / "bowl.stl")
    return path


def _evaluated(demonstrations, folds, *_, **__) -> dict:
    """What is printed of an evaluation, in place of seconds of scoring (test_evaluate)."""
    nothing = {"known_phase": {"1.0": {"accuracy": 1.0}}, "unknown_phase": {"1.0": {"rmse": None}}}
    online = {"known_phase": {"n": 1, **dict.fromkeys(ONLINE_COLUMNS, 0.0)}}
    return {
        "n_demonstrations": len(demonstrations),
        "tasks": [*{d.task: None for d in demonstrations}],
        "unit": "rad",
        "segment": "recording",
        "left_out": [],
        "doubtful": [],
        "mistaken": [],
        "recognition": nothing,
        "prediction": nothing,
        "reactive": {"task": {"0.5": dict.fromkeys(REACTIVE_NAMES, 0.0)}},
        "online": online,
        "none": {"area": None},
    }


@cache
def _reported():
    recordings = [perform(TRUTH, k % 2, k) for k in range(4)]
    return learn_with_report(recordings, TrainingSettings(n_basis=8))


def _trained(*_) -> tuple[Model, TrainingReport]:
    """In place of learning the same twice (test_train)."""
    return Model(_reported().library, DOFS), _reported()


def _run_here(entries, settings, *_) -> dict[str, ExperimentRun]:
    """In place of processes that are started anew (test_experiments)."""
    return {entry.name: ExperimentRun(experiment_stub.run(settings), "", 0.0) for entry in entries}


@pytest.mark.slow
@pytest.mark.parametrize("words", [*filter(None, COMMANDS.values()), *MORE], ids=" ".join)
def test_without_a_file_it_is_all_of_standard_output(words, folder, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(folder)
    stub = Experiment("stub", "experiment_stub", "Nobody, Fig. 0", "a stub")
    monkeypatch.setattr(catalogue, "EXPERIMENTS", (stub,))
    monkeypatch.setattr("experiments.runs.run_all", _run_here)
    monkeypatch.setattr("intent_recognition.cli.evaluate.evaluate", _evaluated)
    monkeypatch.setattr("intent_recognition.cli.train.train", _trained)

    def run(number: int, *json_option: str) -> str:
        new = str(tmp_path / f"new_{number}")
        assert cli.main([word.replace("NEW", new) for word in words] + [*json_option]) == 0
        return capsys.readouterr().out.replace(new, "NEW")

    printed = run(1, "--json")
    out = tmp_path / "deep" / "out.json"
    shown = run(2, "--json", str(out))
    assert out.read_text("utf-8").replace(str(tmp_path / "new_2"), "NEW") == printed
    assert json.loads(printed)
    with pytest.raises(ValueError, match=r"Expecting value|Extra data"):
        json.loads(shown)


def test_every_command_that_has_it_has_it_so():
    (commands,) = (a for a in cli.make_parser()._actions if a.choices and not a.option_strings)
    options = {name: one._option_string_actions for name, one in commands.choices.items()}
    found = {name: known["--json"] for name, known in options.items() if "--json" in known}
    assert found.keys() == COMMANDS.keys()
    for option in found.values():
        assert (option.nargs, option.const, option.metavar) == ("?", PRINTED, "OUT")


def test_a_recording_that_it_took_for_its_file_is_kept(folder, capsys, monkeypatch):
    """Where `--json` stands before a second bag."""
    monkeypatch.chdir(folder)
    (recording,) = Path("bag").glob("*.mcap")
    before = recording.read_bytes()
    assert cli.main(["inspect", "--json", str(recording), "bags"]) == 1
    assert "Write `--json` last" in capsys.readouterr().err
    assert recording.read_bytes() == before


@pytest.mark.parametrize(
    "words",
    [
        ("train", "bags", "--dofs", "dofs.yaml", "--output", "deep/both"),
        ("evaluate", "bags", "--dofs", "dofs.yaml", "--report", "deep/both"),
        ("warp", "mug", "bowl.stl", "--report", "deep/both"),
    ],
    ids=lambda words: words[0],
)
def test_it_does_not_write_over_the_other_file_of_its_command(words, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert cli.main([*words, "--json", "deep/../deep/both"]) == 1
    message = f"--json deep/../deep/both: expected another file than {words[-2]}, got the same"
    assert message in capsys.readouterr().err
    assert not (folder / "deep").exists()


def test_what_is_not_plain_is_an_error_not_a_text(tmp_path):
    with pytest.raises(TypeError, match="int64"):
        write_json(tmp_path / "n.json", {"n": np.int64(3)})

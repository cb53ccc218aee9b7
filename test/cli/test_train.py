# SPDX-License-Identifier: Apache-2.0
"""`intent train`: what it learns, leaves out, adds to a model, and learns from sessions."""

import io
import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_builder import POSE, START_NS, pose, write_bag
from cli.recorded import DOFS, PER_TASK, TRUTH, spoil
from model_builder import GLOVE, make_dofs, perform, true_library, write_recording
from rich.console import Console

from intent_recognition import __version__
from intent_recognition.bags import BagWriter
from intent_recognition.cli.main import main
from intent_recognition.cli.train import print_library, with_sessions
from intent_recognition.errors import ArgumentError, BagError, DofError, TrainingError
from intent_recognition.learning import Hyperparameters, Trained, TrainingReport, TrainingSettings
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions
from intent_recognition.model import Model, load_model, load_trained


@pytest.mark.slow
def test_it_learns_writes_and_tells(train, recorded):
    output, text = train(recorded / "bags", recorded / "bags/../bags/demo_00")  # once each
    model = load_model(output)
    assert model.dofs == DOFS and model.labels == ("task_0", "task_1")
    assert model.library.n_demonstrations.tolist() == [PER_TASK, PER_TASK]
    assert model.library.basis.n_basis in (8, TrainingSettings.n_aligned_basis)
    provenance = model.library.provenance
    assert provenance["package_version"] == __version__
    assert provenance["bags"] == [f"demo_{k:02d}" for k in range(8)]
    assert provenance["settings"]["n_basis"] == 8
    for word in ("task_0", "task_1", "learned from 8 demonstrations", "cross-validation", "wrote"):
        assert word in text, text
    assert str(output) in text.replace("\n", "")
    assert "duration [s]" in text


@pytest.mark.parametrize(
    ("log_loss", "warned"), [(0.69, False), (0.70, True), (float("nan"), False)]
)
def test_recognition_worse_than_guessing_is_a_warning(log_loss, warned):
    library, text = true_library(DOFS, n_tasks=2), io.StringIO()
    chosen = Hyperparameters(log_loss=log_loss, error=0.1)
    report = TrainingReport((), (), chosen, (chosen,), 8, 0, Trained(library, None, {}, chosen))
    print_library(Console(file=text, width=200), library, report)
    assert ("Guessing would recognise the tasks better" in text.getvalue()) == warned
    assert "chosen from 1 candidates" in text.getvalue()


@pytest.mark.slow
def test_broken_bags_are_left_out_and_named_to_users_and_scripts(train, recorded, tmp_path):
    reasons = spoil(tmp_path / "spoiled")
    numbers = tmp_path / "numbers.json"
    output, text = train(recorded / "bags", tmp_path / "spoiled", "--json", numbers)
    assert "topic /joint_states" in text
    for name, reason in reasons.items():
        assert f"left out {tmp_path / 'spoiled' / name}" in text or f"left out {name}" in text
        assert reason in text
    assert load_model(output).library.n_demonstrations.tolist() == [PER_TASK, PER_TASK]
    content = json.loads(numbers.read_text(encoding="utf-8"))
    assert content["n_used"] == 2 * PER_TASK and content["output"] == str(output)
    assert content["tasks"]["task_0"]["n_demonstrations"] == PER_TASK
    assert content["regularisation"]["noise_scale"] > 0
    assert content["regularisation"].keys() == set(Hyperparameters._fields)
    left_out = {Path(item["recording"]).name: item["reason"] for item in content["left_out"]}
    assert all(reason in left_out[name] for name, reason in reasons.items())


def test_a_forgotten_dof_file_is_named(run_command, tmp_path):
    with BagWriter(tmp_path / "demos" / "one", {"task": "give"}) as writer:
        writer.write_message("mocap/glove/pose", POSE, pose(0), START_NS)
    arguments = ("--output", tmp_path / "model.npz")
    with pytest.raises(BagError, match="shipped DOF file was used: give another with --dofs"):
        run_command("train", tmp_path / "demos", *arguments)
    with pytest.raises(BagError, match=r"'a/b'\. Give one such as give_cup\.$"):
        run_command("train", write_bag(tmp_path / "mislabelled", task="a/b"), *arguments)
    (tmp_path / "demos" / "dofs.yaml").write_text("")
    for path in (tmp_path / "demos", tmp_path / "demos" / "one"):
        with pytest.raises(BagError, match=r"give --dofs .*demos/dofs.yaml") as caught:
            run_command("train", path, *arguments)
        assert " ns:" not in str(caught.value)


@pytest.fixture
def train_more(run_command, recorded, tmp_path):
    def run(name, numbers, *arguments):
        bags = [recorded / "bags" / f"demo_{k:02d}" for k in numbers]
        code, text = run_command("train", *bags, *arguments, "--output", tmp_path / name)
        assert code == 0
        return tmp_path / name, text

    return run


@pytest.fixture(scope="module")
def first(recorded):
    bags = [str(recorded / "bags" / f"demo_{k:02d}") for k in range(5)]
    path = recorded / "first.npz"
    options = ["--dofs", str(recorded / "dofs.yaml"), "--basis", "8", "--output", str(path)]
    assert main(["train", *bags, *options]) == 0
    return path


@pytest.mark.slow
def test_bags_are_added_and_the_settings_kept(train_more, first):
    """That it is as good as learned anew: test_training_stream.py."""
    path, text = train_more("more.npz", (5, 6, 7), "--add", first)
    more = load_model(path).library
    assert "learned from 8 demonstrations" in text
    assert more.n_demonstrations.tolist() == [4, 4]
    assert more.provenance["bags"] == [f"demo_{k:02d}" for k in range(8)]
    assert load_model(first).library.n_demonstrations.sum() == 5
    assert "already has" not in text and "chosen from" not in text and "log loss" not in text
    assert "settings kept: " in text


@pytest.mark.slow
def test_a_recording_that_the_model_has_is_named(train_more, first):
    path, text = train_more("twice.npz", (3, 4, 5), "--add", first)
    assert "the model already has recordings of these names: demo_03, demo_04\n" in text
    assert load_model(path).library.n_demonstrations.sum() == 8


@pytest.mark.slow
def test_the_regularisation_may_be_chosen_again(train_more, first, recorded):
    kept = load_trained(first)[1].chosen
    again, text = train_more("again.npz", (5, 6, 7), "--add", first, "--choose-again")
    trained = load_trained(again)[1]
    assert " candidates by cross-validation" in text
    assert trained.chosen.score != kept.score
    assert trained.library.provenance["chosen"] == trained.chosen._asdict()
    assert trained.library.noise_scale == trained.chosen.noise_scale


def test_nothing_to_add_is_an_error(first, tmp_path, run_command):
    nameless = write_recording(tmp_path / "nameless", perform(TRUTH, 1, 5), DOFS, task="")
    with pytest.raises(TrainingError, match="BAG: expected a demonstration that can be added"):
        run_command("train", nameless, "--add", first, "--output", tmp_path / "more.npz")


def test_options_that_contradict_the_model_are_refused(train_more, first, recorded, tmp_path):
    with pytest.raises(ArgumentError, match=r"--basis: expected 8, as in .*first\.npz, got 12"):
        train_more("more.npz", (5,), "--add", first, "--basis", 12)
    with pytest.raises(ArgumentError, match="--segment: expected movement"):
        train_more("more.npz", (5,), "--add", first, "--segment", "recording")
    (tmp_path / "glove.yaml").write_text(yaml.safe_dump(make_dofs(GLOVE).to_dict()))
    with pytest.raises(DofError, match="the DOFs of the model"):
        train_more("more.npz", (5,), "--add", first, "--dofs", tmp_path / "glove.yaml")


STRING = "std_msgs/msg/String"


ORDERS = (("task_0", "task_1") * 5, ("task_1", "task_0", "dance", "task_1"))


@pytest.fixture(scope="module")
def sessions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sessions")
    for number, order in enumerate(ORDERS):
        write_session(folder / f"session_{number}", order)
    return folder


def write_session(path, order):
    with BagWriter(path) as writer:
        for k, label in enumerate(order):
            for shift, text in ((0, label), (2, "")):
                at_ns = 10**18 + (5 * k + shift) * 10**9
                writer.write_message("demonstration", STRING, {"data": text}, at_ns)


@pytest.mark.slow
def test_sessions_give_the_transition_prior_and_nothing_else(train, recorded, sessions):
    path, _ = train(recorded / "bags")
    plain = load_model(path).library
    np.testing.assert_array_equal(plain.transition_prior, np.full((3, 2), 0.5))
    path, text = train(recorded / "bags", "--sessions", sessions)
    library = load_model(path).library
    counts = count_transitions(ORDERS, library.labels)
    np.testing.assert_allclose(library.transition_prior, smoothed_transitions(counts))
    assert library.provenance["sessions"] == ["session_0", "session_1"]
    assert library.provenance["transition_counts"] == counts.astype(int).tolist()
    np.testing.assert_array_equal(library.weight_mean, plain.weight_mean)
    assert "which task follows which" in text and "dance" in text and "no task" in text


def test_sessions_are_looked_for_before_the_work(recorded, tmp_path, capsys):
    words = ["train", str(recorded / "no_bags"), "--output", str(tmp_path / "m.npz")]
    assert main([*words, "--sessions", str(tmp_path / "elsewhere")]) == 1
    assert "elsewhere" in capsys.readouterr().err


def test_sessions_without_a_task_of_the_model_are_refused(recorded, tmp_path):
    write_session(tmp_path / "other", ("dance", "sing"))
    model = Model(TRUTH, DOFS)
    with pytest.raises(BagError, match=r"--sessions.*task_0.*dance, sing"):
        with_sessions(model, [tmp_path / "other"], Console())
    with pytest.raises(BagError, match="without labels"):
        with_sessions(model, [recorded / "bags"], Console())

# SPDX-License-Identifier: Apache-2.0
"""`intent train`: what it learns, what it leaves out and says so."""

import io
import json
from pathlib import Path

import pytest
import yaml
from bag_builder import POSE, START_NS, pose, write_bag
from cli.recorded import DOFS, PER_TASK, spoil
from model_builder import GLOVE, make_dofs, true_library
from rich.console import Console

from intent_recognition import __version__
from intent_recognition.bags import BagWriter
from intent_recognition.cli.train import print_library
from intent_recognition.errors import BagError, DofError, ResourceBusyError, TrainingError
from intent_recognition.learning import Hyperparameters, Trained, TrainingReport, TrainingSettings
from intent_recognition.model.file import load_model


@pytest.fixture
def train(run_command, recorded, tmp_path):
    def run(*arguments, dofs="dofs.yaml"):
        output = tmp_path / "new" / "model.npz"
        options = ("--dofs", recorded / dofs, "--basis", 8, "--output", output)
        code, text = run_command("train", *arguments, *options)
        return code, text, output

    return run


@pytest.mark.slow
def test_it_learns_writes_and_tells(train, recorded):
    code, text, output = train(recorded / "bags")
    assert code == 0
    model = load_model(output)
    assert model.dofs == DOFS and model.labels == ("task_0", "task_1")
    assert model.library.n_demonstrations.tolist() == [PER_TASK, PER_TASK]
    assert model.library.basis.n_basis in (8, TrainingSettings.n_aligned_basis)
    provenance = model.library.provenance
    assert provenance["package_version"] == __version__
    assert provenance["bags"] == [f"demo_{k:02d}" for k in range(8)]
    assert provenance["settings"]["n_basis"] == 8
    for word in ("task_0", "task_1", "learned from 8 demonstrations", "left out", "wrote"):
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
    assert "best of 1 settings" in text.getvalue()


@pytest.mark.slow
def test_broken_bags_are_left_out_and_named_to_users_and_scripts(train, recorded, tmp_path):
    reasons = spoil(tmp_path / "spoiled")
    numbers = tmp_path / "numbers.json"
    code, text, output = train(recorded / "bags", tmp_path / "spoiled", "--json", numbers)
    assert code == 0 and "topic /joint_states" in text
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


def test_nothing_to_learn_from_is_refused_with_the_reason(train, recorded, tmp_path):
    with pytest.raises(BagError, match="/no/bag"):
        train("/no/bag")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match="empty"):
        train(tmp_path / "empty")
    with pytest.raises(TrainingError, match="two"):
        train(recorded / "bags" / "demo_00")


def test_dofs_the_bags_do_not_have_are_refused(train, recorded):
    content = make_dofs(*DOFS.observed, GLOVE).to_dict()
    (recorded / "glove.yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(BagError, match="glove/joint_states"):
        train(recorded / "bags", dofs="glove.yaml")
    with pytest.raises(DofError, match=r"no\.yaml"):
        train(recorded / "bags", dofs="no.yaml")


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


def test_an_output_that_cannot_be_written_is_refused_before_the_work(run_command, tmp_path):
    (tmp_path / "file").write_text("")
    for output in (tmp_path, tmp_path / "file" / "model.npz"):
        with pytest.raises(ResourceBusyError, match="--output"):
            run_command("train", "/no/bag", "--output", output)

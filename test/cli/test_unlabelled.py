# SPDX-License-Identifier: Apache-2.0
"""`--unlabelled` of `intent train` and `intent evaluate`."""

import json
import shutil

import numpy as np
import pytest
from cli.recorded import DOFS, TRUTH, write_all
from model_builder import perform, write_recording

from intent_recognition.errors import ArgumentError
from intent_recognition.model.file import load_model


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Labelled recordings in `bags`, the same tasks without labels in `nameless`."""
    folder = tmp_path_factory.mktemp("recorded")
    write_all(folder)
    for number in range(8):
        recording = perform(TRUTH, number % 2, number, rate_hz=25.0)
        write_recording(folder / "nameless" / f"n_{number}", recording, DOFS, task="")
    return folder


@pytest.fixture
def run(run_command, recorded, tmp_path):
    def command(name, bags, *arguments):
        output = tmp_path / ("model.npz" if name == "train" else "scores.json")
        option = "--output" if name == "train" else "--json"
        options = ("--dofs", recorded / "dofs.yaml", "--basis", 8, option, output)
        code, text = run_command(name, recorded / bags, *options, *arguments)
        assert code == 0
        return text, output

    return command


@pytest.mark.slow
def test_training_without_labels(run):
    text, output = run("train", "nameless", "--unlabelled")
    library = load_model(output).library
    assert library.labels == ("component_1", "component_2")
    assert library.n_demonstrations.tolist() == [4, 4]
    np.testing.assert_allclose(library.task_prior, 0.5)
    assert library.provenance["components"][:2] == ["component_1", "component_2"]
    assert "2 components" in text and "purity" not in text and "taken" in text


@pytest.mark.parametrize(
    "arguments",
    [
        ("--components", 2),
        ("--unlabelled", "--components", "many"),
        ("--unlabelled", "--components", 0),
        ("--unlabelled", "--jobs", 2),
        ("--unlabelled", "--scheduler", "tcp://127.0.0.1:1"),
        ("--unlabelled", "--add", "model.npz"),
    ],
)
def test_options_that_contradict_each_other_are_refused(run, arguments):
    with pytest.raises(ArgumentError, match=r"--components|--unlabelled"):
        run("train", "bags", *arguments)


@pytest.mark.slow
def test_some_without_labels_are_clustered_but_not_scored(run, recorded, tmp_path):
    for name in ("bags", "nameless"):
        shutil.copytree(recorded / name, tmp_path / "all", dirs_exist_ok=True)
    for name in ("bags/demo_00", "bags/demo_01", "nameless/n_0"):
        shutil.copytree(recorded / name, tmp_path / "test" / name)
    arguments = ("--unlabelled", "--test", tmp_path / "test", "--unknown-tasks", "off")
    text, output = run("evaluate", tmp_path / "all", *arguments)
    result = json.loads(output.read_text())
    assert result["mixture"]["purity"] == 1.0
    assert result["n_demonstrations"] == 2 and "recognition" in result
    assert f"{result['mixture']['n_components']} components" in text


@pytest.mark.slow
def test_the_number_of_components_may_be_given(run):
    text, output = run("train", "bags", "--unlabelled", "--components", 1)
    assert load_model(output).library.labels == ("component_1",)
    assert "purity 0.500" in text


@pytest.fixture
def damaged(recorded, tmp_path):
    """Recordings without labels, of which one cannot be read."""
    folder = shutil.copytree(recorded / "nameless", tmp_path / "damaged")
    (folder / "n_0" / "n_0_0.mcap").write_bytes(b"")
    return folder


def test_what_was_left_out_is_told_to_users_and_scripts(run, damaged, tmp_path):
    written = tmp_path / "trained.json"
    text, _ = run("train", damaged, "--unlabelled", "--components", 1, "--json", written)
    (left_out,) = json.loads(written.read_text())["left_out"]
    assert left_out["recording"] == str(damaged / "n_0")
    assert text.count(f"left out {damaged / 'n_0'}") == 1
    page = tmp_path / "page.html"
    text, output = run("evaluate", damaged, "--unlabelled", "--components", 1, "--report", page)
    (left_out,) = json.loads(output.read_text())["left_out"]
    assert left_out["recording"] == "n_0"
    assert text.count(f"left out {damaged / 'n_0'}") == 1
    assert "Without labels" in page.read_text() and f"wrote {page}" in text


def test_evaluation_of_recordings_without_a_single_label(run):
    text, output = run("evaluate", "nameless", "--unlabelled")
    result = json.loads(output.read_text())
    assert result["mixture"] == {"n_components": 2, "purity": None}
    assert result["n_demonstrations"] == 8 and result["tasks"] == []
    assert "no recording has a label" in text

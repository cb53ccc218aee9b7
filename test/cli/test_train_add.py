# SPDX-License-Identifier: Apache-2.0
"""`intent train --add`: a later session adds to a model, without the bags it was learned from."""

import numpy as np
import pytest
import yaml
from model_builder import GLOVE, make_dofs

from intent_recognition.cli.main import main
from intent_recognition.errors import ArgumentError, DofError, ModelError, TrainingError
from intent_recognition.learning.fitting import library_from_statistics
from intent_recognition.model.file import load_model, load_trained, save_model
from intent_recognition.model.from_bags import accumulate_bags


@pytest.fixture
def train(run_command, recorded, tmp_path):
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
def test_added_bags_are_as_good_as_learned_anew(train, first, recorded):
    before, trained = load_trained(first)
    path, text = train("more.npz", (5, 6, 7), "--add", first)
    more = load_model(path).library
    assert "learned from 8 demonstrations" in text
    parts = [recorded / "bags" / f"demo_{k:02d}" for k in range(8)]
    every = accumulate_bags(
        parts, before.dofs, trained.preprocessing.settings, preprocessing=trained.preprocessing
    )
    expected = library_from_statistics(
        every.accumulated.tasks, trained.preprocessing, trained.chosen
    )
    np.testing.assert_allclose(more.weight_mean, expected.weight_mean, atol=1e-10)
    np.testing.assert_allclose(more.weight_covariance, expected.weight_covariance, atol=1e-10)
    np.testing.assert_allclose(more.noise_variance, expected.noise_variance, rtol=1e-10)
    assert more.n_demonstrations.tolist() == [4, 4]
    assert more.provenance["bags"] == [f"demo_{k:02d}" for k in range(8)]
    assert load_model(first).library.n_demonstrations.sum() == 5
    assert "already has" not in text and "best of" not in text and "log loss" not in text
    assert "settings kept: " in text


@pytest.mark.slow
def test_a_recording_that_the_model_has_is_named(train, first):
    path, text = train("twice.npz", (3, 4, 5), "--add", first)
    assert "the model already has recordings of these names: demo_03, demo_04\n" in text
    assert load_model(path).library.n_demonstrations.sum() == 8


@pytest.mark.slow
def test_the_regularisation_may_be_chosen_again(train, first, recorded):
    kept = load_trained(first)[1].chosen
    again, text = train("again.npz", (5, 6, 7), "--add", first, "--choose-again")
    trained = load_trained(again)[1]
    assert "best of 13 settings, by predicting demonstrations left out" in text
    assert trained.chosen.score != kept.score
    assert trained.library.provenance["chosen"] == trained.chosen._asdict()
    assert trained.library.noise_scale == trained.chosen.noise_scale


def test_a_model_without_statistics_says_what_it_lacks(train, first, tmp_path):
    save_model(tmp_path / "old.npz", load_model(first))
    with pytest.raises(ModelError, match=r"old\.npz: expected statistics to add demonstrations to"):
        train("more.npz", (5,), "--add", tmp_path / "old.npz")


def test_nothing_to_add_is_an_error(train, first, recorded, tmp_path, run_command):
    nameless = tmp_path / "nameless"
    content = recorded / "bags" / "demo_05"
    nameless.mkdir()
    for path in content.iterdir():
        text = path.read_bytes()
        if path.name == "metadata.yaml":
            text = text.replace(b"task: task_1", b"note: task_1")
        (nameless / path.name).write_bytes(text)
    with pytest.raises(TrainingError, match="BAG: expected a demonstration that can be added"):
        run_command("train", nameless, "--add", first, "--output", tmp_path / "more.npz")


def test_options_that_contradict_the_model_are_refused(train, first, recorded, tmp_path):
    with pytest.raises(ArgumentError, match=r"--basis: expected 8, as in .*first\.npz, got 12"):
        train("more.npz", (5,), "--add", first, "--basis", 12)
    with pytest.raises(ArgumentError, match="--segment: expected movement"):
        train("more.npz", (5,), "--add", first, "--segment", "recording")
    (tmp_path / "glove.yaml").write_text(yaml.safe_dump(make_dofs(GLOVE).to_dict()))
    with pytest.raises(DofError, match="the DOFs of the model"):
        train("more.npz", (5,), "--add", first, "--dofs", tmp_path / "glove.yaml")

# SPDX-License-Identifier: Apache-2.0
"""Statistics in the model file: exact there and back, passed by where they are not wanted."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from model_builder import make_dofs, perform, true_library

from intent_recognition.errors import ModelError
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.training import TrainingSettings, add_demonstration, learn
from intent_recognition.storage.model import Model, load_model, load_trained, save_model

DOFS = make_dofs()
TRUTH = true_library(DOFS)


@pytest.fixture(scope="module")
def trained():
    recordings = [perform(TRUTH, k % 3, k) for k in range(8)]
    return learn(recordings, TrainingSettings(n_basis=6))[1].trained


@pytest.fixture(scope="module")
def written(trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "model.npz"
    save_model(path, Model(trained.library, DOFS), trained)
    return path


def assert_identical(found: TaskLibrary, expected: TaskLibrary) -> None:
    for field in fields(TaskLibrary):
        ours, theirs = getattr(expected, field.name), getattr(found, field.name)
        assert np.array_equal(ours, theirs) if isinstance(ours, np.ndarray) else ours == theirs


def test_what_was_written_is_read_bit_for_bit(trained, written):
    model, read = load_trained(written)
    assert model.dofs == DOFS and read.library is model.library
    assert (read.reference, read.chosen) == (trained.reference, trained.chosen)
    assert list(read.tasks) == list(trained.tasks)
    for label, task in trained.tasks.items():
        for name, value in vars(task).items():
            if name != "examples":
                assert np.array_equal(getattr(read.tasks[label], name), value), name
        for ours, theirs in zip(task.examples, read.tasks[label].examples, strict=True):
            assert all(map(np.array_equal, ours, theirs))


def test_a_later_session_adds_the_same(trained, written):
    recorded = perform(TRUTH, 1, 30)
    later = add_demonstration(load_trained(written)[1], recorded)
    assert_identical(later.library, add_demonstration(trained, recorded).library)


def test_the_model_alone_is_read_without_them(trained, written, tmp_path):
    save_model(tmp_path / "plain.npz", Model(trained.library, DOFS))
    assert_identical(load_model(written).library, load_model(tmp_path / "plain.npz").library)


def test_a_model_without_statistics_says_so(trained, tmp_path):
    save_model(tmp_path / "old.npz", Model(trained.library, DOFS))
    with pytest.raises(ModelError, match=r"old\.npz: .*statistics.*older version.*Train it again"):
        load_trained(tmp_path / "old.npz")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("statistics_mean", lambda a: a[:, :-1]),
        ("statistics_scatter", lambda a: a * np.nan),
        ("statistics_n", lambda a: a.astype(float)),
        ("examples_weights", lambda a: None),
        ("examples_count", lambda a: a[::-1] * 0),
    ],
)
def test_what_is_damaged_is_named(written, tmp_path, name, change):
    with np.load(written, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}
    changed = arrays | {name: change(arrays[name])}
    path = tmp_path / "bad.npz"
    np.savez(path, **{key: value for key, value in changed.items() if value is not None})
    with pytest.raises(ModelError, match=rf"bad\.npz: {name}"):
        load_trained(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda s: s.pop("reference"),
        lambda s: s["reference"]["settings"].update(n_basis="many", colour="red"),
        lambda s: s.update(labels=["other"]),
        lambda s: s.update(chosen={}),
    ],
)
def test_a_damaged_header_is_named(written, tmp_path, change):
    with np.load(written, allow_pickle=False) as file:
        arrays = {key: file[key] for key in file.files}
    header = json.loads(str(arrays["header"]))
    change(header["statistics"])
    np.savez(tmp_path / "bad.npz", **(arrays | {"header": np.array(json.dumps(header))}))
    with pytest.raises(ModelError, match=r"bad\.npz: statistics"):
        load_trained(tmp_path / "bad.npz")


def test_priors_changed_after_learning_are_kept(trained, tmp_path):
    """The library written is the model's; the statistics only tell how to go on."""
    prior = np.array([0.5, 0.25, 0.25])
    library = replace(trained.library, task_prior=prior)
    save_model(tmp_path / "model.npz", Model(library, DOFS), trained)
    added = add_demonstration(load_trained(tmp_path / "model.npz")[1], perform(TRUTH, 0, 31))
    assert np.array_equal(added.library.task_prior, prior)

# SPDX-License-Identifier: Apache-2.0
"""Statistics in the model file: exact there and back, passed by where they are not wanted."""

import json
import shutil
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from model_builder import make_dofs, perform, true_library
from same_library import assert_same
from simulation import gathered

from intent_recognition.errors import ModelError
from intent_recognition.learning import TrainingSettings, add_demonstration, library_from_statistics
from intent_recognition.model.file import Model, load_model, load_trained, save_model

DOFS = make_dofs()
TRUTH = true_library(DOFS)


@pytest.fixture(scope="module")
def learned():
    recordings = [perform(TRUTH, k % 3, k) for k in range(8)]
    return gathered(recordings, TrainingSettings(n_basis=6, n_aligned_basis=9))


@pytest.fixture(scope="module", params=["shared", "aligned"])
def trained(learned, request):
    scores = {"log_loss": 0.1, "error": 0.2, "score": 0.3}
    timing = replace(learned.preprocessing.timing, delay_s=0.25)
    trained = replace(learned, preprocessing=replace(learned.preprocessing, timing=timing))
    chosen = learned.chosen._replace(pace=request.param, **scores)
    library = library_from_statistics(trained.tasks, trained.preprocessing, chosen)
    return replace(trained, library=library, chosen=chosen)


@pytest.fixture(scope="module")
def written(trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "model.npz"
    save_model(path, Model(trained.library, DOFS), trained)
    return path


assert_identical = partial(assert_same, rtol=0.0, apart=())


def test_what_was_written_is_read_bit_for_bit(trained, written):
    model, read = load_trained(written)
    assert model.dofs == DOFS and read.library is model.library
    assert (read.preprocessing, read.chosen) == (trained.preprocessing, trained.chosen)
    assert list(read.tasks) == list(trained.tasks)
    for label, task in trained.tasks.items():
        assert_identical(read.tasks[label], task)


def test_a_later_session_adds_the_same(trained, written):
    recorded = perform(TRUTH, 1, 30)
    later = add_demonstration(load_trained(written)[1], recorded)
    assert_identical(later.library, add_demonstration(trained, recorded).library)


def test_a_file_that_is_replaced_meanwhile_is_read_as_one(trained, written, tmp_path, monkeypatch):
    path, other, load = tmp_path / "model.npz", tmp_path / "other.npz", np.load
    shutil.copy(written, path)
    later = add_demonstration(trained, perform(TRUTH, 1, 30))
    save_model(other, Model(later.library, DOFS), later)

    def load_and_replace(*args, **options):
        found = load(*args, **options)
        if other.exists():
            other.replace(path)
        return found

    monkeypatch.setattr(np, "load", load_and_replace)
    _, read = load_trained(path)
    assert not other.exists()
    assert [task.n for task in read.tasks.values()] == [task.n for task in trained.tasks.values()]
    assert_identical(read.library, trained.library)


def test_the_model_alone_is_read_without_them(trained, written, tmp_path):
    save_model(tmp_path / "plain.npz", Model(trained.library, DOFS))
    assert_identical(load_model(written).library, load_model(tmp_path / "plain.npz").library)


def test_a_model_without_statistics_says_so(trained, tmp_path):
    save_model(tmp_path / "old.npz", Model(trained.library, DOFS))
    with pytest.raises(
        ModelError, match=r"old\.npz: expected statistics .*, got a model without them. Train it"
    ):
        load_trained(tmp_path / "old.npz")


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("statistics_mean", lambda a: a[:, :-1]),
        ("aligned_statistics_mean", lambda a: a[:, :-1]),
        ("aligned_examples_weights", lambda a: None),
        ("timing_deviation_std", lambda a: a * 0.0),
        ("timing_values", lambda a: a[:-1]),
        ("timing_scale", lambda a: a * np.nan),
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
        lambda s: s.pop("preprocessing"),
        lambda s: s["preprocessing"]["settings"].update(n_basis="many", colour="red"),
        lambda s: s.update(labels=["other"]),
        lambda s: s.update(chosen={}),
        lambda s: s.update(chosen=3),
        lambda s: s["chosen"].update(colour=10.0),
        lambda s: s["chosen"].update(pace=None),
        lambda s: s["chosen"].update(pace="own" if s["chosen"]["pace"] == "aligned" else "aligned"),
        lambda s: s["chosen"].update(noise_scale="4"),
        lambda s: s["preprocessing"].pop("templates"),
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
    library = replace(trained.library, task_prior=prior, task_evidence=0.7)
    save_model(tmp_path / "model.npz", Model(library, DOFS), trained)
    added = add_demonstration(load_trained(tmp_path / "model.npz")[1], perform(TRUTH, 0, 31))
    assert np.array_equal(added.library.task_prior, prior)
    assert added.library.task_evidence == 0.7

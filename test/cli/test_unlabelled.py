# SPDX-License-Identifier: Apache-2.0
"""`intent train` without labels, and where several processes read its bags."""

import gc
import json
import os
import shutil
import signal
import sys
from functools import partial

import numpy as np
import pytest
from cli.recorded import DOFS, TRUTH, spoil
from model_builder import perform, write_recording
from same_library import assert_same

from intent_recognition.cli.train_workers import workers
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.errors import (
    ArgumentError,
    DofError,
    IntentError,
    MissingPackageError,
    ResourceBusyError,
)
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.model import accumulate_bags, load_model
from intent_recognition.model import from_bags as accumulate
from intent_recognition.model.from_bags import split_evenly


@pytest.fixture(scope="module")
def recorded(recorded, tmp_path_factory):
    """Labelled recordings in `bags`, the same tasks in `nameless`, and what cannot be used."""
    folder = shutil.copytree(recorded, tmp_path_factory.mktemp("recorded") / "all")
    for number in range(8):
        recording = perform(TRUTH, number % 2, number, rate_hz=25.0)
        write_recording(folder / "nameless" / f"n_{number}", recording, DOFS, task="")
    spoil(folder / "spoiled")
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
    assert f"{result['mixture']['n_components']} components" in text and "purity 1.000" in text


@pytest.fixture
def damaged(recorded, tmp_path):
    """Recordings without labels, of which one cannot be read."""
    folder = shutil.copytree(recorded / "nameless", tmp_path / "damaged")
    (folder / "n_0" / "n_0_0.mcap").write_bytes(b"")
    return folder


def test_what_was_left_out_is_told_to_users_and_scripts(run, damaged, tmp_path):
    written = tmp_path / "trained.json"
    text, model = run("train", damaged, "--unlabelled", "--components", 1, "--json", written)
    assert load_model(model).library.labels == ("component_1",)
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


@pytest.fixture(autouse=True)
def no_client_is_left():
    """One of dask that is collected while the next one starts waits for itself, for ever."""
    yield
    gc.collect()


@pytest.fixture
def small_parts(monkeypatch):
    """Three bags settle the reference; the rest is read two at a time."""
    monkeypatch.setattr(accumulate, "REFERENCE_RECORDINGS", 3)
    monkeypatch.setattr(accumulate, "BATCH", 2)


def assert_same_bags(*models):
    found, expected = (load_model(path).library for path in models)
    assert_same(found, expected, rtol=1e-12)
    assert found.provenance["bags"] == expected.provenance["bags"]


@pytest.mark.slow
def test_processes_learn_the_same_model(train, recorded, small_parts):
    folders = recorded / "bags", recorded / "spoiled"
    alone, text = train(*folders)
    together, text_together = train(*folders, "--jobs", 2)
    assert_same_bags(together, alone)
    assert load_model(together).library.n_demonstrations.tolist() == [4, 4]
    left_out = [line for line in text.splitlines() if "left out" in line]
    assert len(left_out) >= 5
    assert [line for line in text_together.splitlines() if "left out" in line] == left_out


@pytest.fixture(scope="module")
def cluster():
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        host="127.0.0.1",
        protocol="tcp",
        dashboard_address="127.0.0.1:0",
    ) as started:
        yield started


@pytest.mark.slow
def test_a_dask_scheduler_learns_the_same_model(train, recorded, small_parts, cluster):
    assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
    elsewhere, _ = train(recorded / "bags", "--scheduler", cluster.scheduler_address)
    assert_same_bags(elsewhere, train(recorded / "bags")[0])


def test_without_dask_the_cure_is_named(train, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingPackageError, match="pip install distributed"):
        train("bags", "--scheduler", "tcp://127.0.0.1:1")


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_one_line(train, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("intent_recognition.cli.train_workers.CONNECT_S", 0.3)
    with pytest.raises(ResourceBusyError, match=r"--scheduler tcp://127\.0\.0\.1:1: .*--jobs"):
        train("bags", "--scheduler", "tcp://127.0.0.1:1")
    with pytest.raises(ResourceBusyError, match=r"--scheduler nonsense://x"):
        train("bags", "--scheduler", "nonsense://x")


def test_a_scheduler_without_workers_is_refused(train):
    distributed = pytest.importorskip("distributed")
    options = {"host": "127.0.0.1", "protocol": "tcp", "dashboard_address": "127.0.0.1:0"}
    with (
        distributed.LocalCluster(n_workers=0, processes=False, **options) as empty,
        pytest.raises(ResourceBusyError, match="at least one worker, got none"),
    ):
        train("bags", "--scheduler", empty.scheduler_address)


@pytest.mark.slow
def test_a_worker_that_dies_is_an_error_and_one_that_refuses_says_so():
    with pytest.raises(IntentError, match="--jobs"), workers(2) as run:
        list(run(os._exit, [3, 3, 3]))
    with pytest.raises(DofError, match=r"no\.yaml"), workers(2) as run:
        list(run(load_dofs, ["/no.yaml"] * 3))


def test_an_interrupt_is_not_for_the_workers():
    with workers(2) as run:
        blocked = list(run(partial(signal.pthread_sigmask, signal.SIG_BLOCK), [[]]))
    assert blocked == [{signal.SIGINT}]


def test_results_come_in_order_and_few_at_a_time():
    given = []

    def numbers():
        for number in range(50):
            given.append(number)
            yield number

    with workers(2) as run:
        results = run(abs, numbers())
        assert next(results) == 0
        assert len(given) <= 6
        assert list(results) == list(range(1, 50))


def test_the_reference_is_settled_by_bags_spread_over_all():
    assert split_evenly(list("abcdefghij"), 3) == (list("adg"), list("bcefhij"))
    assert split_evenly(["a", "b"], 3) == (["a", "b"], [])


def test_a_reference_is_found_behind_many_bags_that_cannot_be_used(recorded, small_parts, tmp_path):
    """15 spoiled bags come before any good one; all good ones are learned from."""
    bad = [shutil.copytree(recorded / "spoiled", tmp_path / str(k)) for k in range(3)]
    found = accumulate_bags([*bad, recorded / "bags"], DOFS, TrainingSettings(n_basis=8))
    assert found.accumulated.n_used == 8
    assert found.n_rejections + found.accumulated.n_rejected == 15

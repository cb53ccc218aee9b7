# SPDX-License-Identifier: Apache-2.0
"""A library of tasks on disk: it grows, it goes back, and nothing recorded is lost."""

import json
from dataclasses import replace
from datetime import datetime, timezone

import pytest
from bag_builder import write_bag
from model_builder import make_dofs, perform, true_library, write_recording

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.errors import DofError, ModelError, ResourceBusyError, TrainingError
from intent_recognition.learning import with_margins
from intent_recognition.model import load_model, load_trained, undoable
from intent_recognition.model.task_folder import LEARN, START, UNDO, WAIT, TaskFolder

DOFS = make_dofs()
TRUTH = true_library(DOFS)
NOON = datetime(2026, 1, 1, 12, tzinfo=timezone.utc)


def folder_of(path, dofs=DOFS):
    return TaskFolder(path, dofs, clock=lambda: NOON)


def record(folder, task, seed):
    bag = folder.new_bag(TRUTH.labels[task])
    return write_recording(bag, perform(TRUTH, task, seed), DOFS)


def teach(folder, task, seed):
    return folder.learn(record(folder, task, seed))


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """A folder that has learned two tasks from three recordings each, all recorded before."""
    folder = folder_of(tmp_path_factory.mktemp("tasks") / "mine")
    bags = [record(folder, task, 10 * task + k) for k in range(3) for task in (0, 1)]
    return folder, [folder.learn(bag) for bag in bags]


def copy_of(folder, target):
    import shutil

    shutil.copytree(folder.path, target)
    return folder_of(target)


@pytest.mark.slow
def test_waits_for_a_second_recording_of_a_task_then_learns_all(started):
    _, changes = started
    assert [c.action for c in changes[:3]] == [WAIT, WAIT, LEARN]
    assert dict(changes[2].tasks) == {TRUTH.labels[0]: 2, TRUTH.labels[1]: 1}
    assert dict(changes[-1].tasks) == {TRUTH.labels[0]: 3, TRUTH.labels[1]: 3}


@pytest.mark.slow
def test_evidence_against_none_is_read_as_by_training_anew(started):
    """A first model of two recordings knows nothing of unknown movements; the next ones tell."""
    _, trained = load_trained(started[0].model_path)
    anew = with_margins(trained).library.none_margin
    assert trained.library.none_margin == pytest.approx(anew, rel=1e-6)
    first = load_model(started[0].path / "models" / "0001.npz").library
    assert first.none_margin != pytest.approx(anew, rel=0.01)


@pytest.mark.slow
def test_what_is_doubtful_in_a_recording_is_told(started, tmp_path):
    """In another frame: of five recordings of its task four show where it is."""
    folder = copy_of(started[0], tmp_path / "copy")
    assert not folder.doubts
    teach(folder, 0, 20)
    assert not folder.doubts
    (human,) = (odd := perform(TRUTH, 0, 21)).observed
    odd = replace(odd, observed=(replace(human, values=human.values + 1.0),))
    bag = write_recording(folder.new_bag(TRUTH.labels[0]), odd, DOFS)
    assert folder.learn(bag).tasks[TRUTH.labels[0]] == 5
    (doubt,) = folder.doubts
    assert doubt.startswith(f"{bag.name}: ") and "Likely another frame, 1.7 m away" in doubt


@pytest.mark.slow
def test_undo_brings_the_model_before_back_and_keeps_the_recording(started, tmp_path):
    folder = copy_of(started[0], tmp_path / "copy")
    before = folder.model_path.read_bytes()
    added = teach(folder, 2, 40)
    assert load_model(folder.model_path).labels == TRUTH.labels
    undone = folder.undo()
    assert undone.action == UNDO
    assert folder.model_path.read_bytes() == before
    assert not (folder.path / added.bag).exists()
    assert (folder.path / added.bag.replace("bags/", "undone/", 1)).exists()
    assert folder.new_bag(TRUTH.labels[2]).name != added.bag.split("/")[-1]


def test_undo_goes_back_as_far_as_there_are_recordings(started, tmp_path):
    folder = copy_of(started[0], tmp_path / "copy")
    for _ in range(6):
        last = undoable(folder.history())
        assert folder.undo().bag == last.bag
    assert not folder.model_path.exists() and undoable(folder.history()) is None
    with pytest.raises(ModelError, match="undo"):
        folder.undo()
    assert len(list((folder.path / "undone").glob("*/*"))) == 6


@pytest.mark.slow
def test_starts_from_a_model_trained_elsewhere_and_never_forgets_it(started, tmp_path):
    folder = folder_of(tmp_path / "new")
    folder.start_from(started[0].model_path)
    assert folder.history()[0].action == START and undoable(folder.history()) is None
    with pytest.raises(ResourceBusyError, match="model"):
        folder.start_from(started[0].model_path)
    teach(folder, 2, 40)
    folder.undo()
    with pytest.raises(ModelError, match="undo"):
        folder.undo()
    assert load_model(folder.model_path).labels == TRUTH.labels[:2]


def test_what_cannot_be_learned_is_set_aside_and_the_model_stays(started, tmp_path):
    folder = copy_of(started[0], tmp_path / "copy")
    before = folder.model_path.read_bytes()
    bag = folder.new_bag("still")
    write_bag(bag, count=3, task="still")
    with pytest.raises(TrainingError, match="undone"):
        folder.learn(bag)
    assert folder.model_path.read_bytes() == before
    assert (folder.path / "undone" / "still" / bag.name).exists()


def test_history_is_one_line_of_json_per_change(started):
    folder, changes = started
    lines = (folder.path / "history.jsonl").read_text().splitlines()
    assert [json.loads(line)["action"] for line in lines] == [c.action for c in changes]
    assert folder.history() == changes
    assert changes[0].time == "2026-01-01T12:00:00.000+00:00"


def test_other_dofs_than_the_models_are_refused(started):
    other = DofSpec((DofEntry("elbow", DOFS.observed[0].type, fields=("pose.position.x",)),),
                    DOFS.controlled)  # fmt: skip
    with pytest.raises(DofError, match="observed"):
        folder_of(started[0].path, other)

# SPDX-License-Identifier: Apache-2.0
"""A correction that is kept moves its task and nothing else; what became of executions stays."""

import shutil

import numpy as np
import pytest
from corrected_execution import NOON, OFFSET, execute
from model_builder import make_dofs, perform, true_library, write_recording

from intent_recognition.errors import BagError, ResourceBusyError
from intent_recognition.model import Executions, load_model, load_trained, skill_history
from intent_recognition.model.executions import Execution
from intent_recognition.model.task_folder import KEEP, START, Change, TaskFolder

DOFS = make_dofs()
TRUTH = true_library(DOFS)


@pytest.fixture(scope="module")
def taught(tmp_path_factory):
    folder = TaskFolder(tmp_path_factory.mktemp("tasks") / "mine", DOFS, clock=lambda: NOON)
    for k in range(3):
        for task in (0, 1):
            bag = folder.new_bag(TRUTH.labels[task])
            folder.learn(write_recording(bag, perform(TRUTH, task, 10 * task + k), DOFS))
    return folder


@pytest.mark.slow
def test_kept_corrections_count_less_and_less_and_undo_takes_them_back(taught):
    folder, label = taught, TRUTH.labels[0]
    file, before = folder.model_path.read_bytes(), load_trained(folder.model_path)[1]
    first = before.library
    k, other = first.labels.index(label), 1 - first.labels.index(label)
    ends = [controlled_end(first, k)]
    for _ in range(3):
        bag = execute(folder, perform(TRUTH, 0, 1))  # what it has seen: all is the correction
        change = folder.learn(folder.correct(bag))
        assert change.action == KEEP and change.tasks[label] == 3
        ends.append(controlled_end(load_model(folder.model_path).library, k))
    moved = (np.array(ends) - ends[0]) @ OFFSET / (OFFSET @ OFFSET)
    whole, second, third = np.diff(moved)
    assert 0.8 < whole < 1.1
    assert abs(second) < 0.1 and abs(third) < 0.1
    model, trained = load_trained(folder.model_path)
    library = model.library
    assert np.array_equal(library.observed_covariance, first.observed_covariance)
    assert np.array_equal(library.weight_mean[other], first.weight_mean[other])
    assert trained.tasks[label].n == before.tasks[label].n
    with pytest.raises(ResourceBusyError):
        folder.correct(bag)
    assert folder.was_kept(bag)
    for _ in range(3):
        folder.undo()
    assert folder.model_path.read_bytes() == file
    assert folder.was_kept(bag)


def test_a_correction_that_was_written_but_not_learned_waits_as_one(taught):
    """As after a kill between the recording and the line in the history."""
    bag = folder_bag = execute(taught, perform(TRUTH, 1, 33))
    target = taught.correct(folder_bag)
    again = TaskFolder(taught.path, DOFS, clock=lambda: NOON)
    assert again.waiting() == [target]
    assert again.learn(target).action == KEEP
    again.undo()
    assert again.was_kept(bag)


def test_what_was_not_corrected_cannot_be_kept(taught):
    bag = Executions(taught.path, lambda: NOON).new_bag("task_0")
    write_recording(bag, perform(TRUTH, 0, 34), DOFS)
    with pytest.raises(BagError, match="corrected"):
        taught.correct(bag)


def test_outcomes_add_up_and_a_torn_line_never_happened(tmp_path):
    executions = Executions(tmp_path, lambda: NOON)
    first = executions.new_bag("cup")
    executions.add(first, {"outcome": "arrived", "corrections": "0"}, "models/0001.npz")
    executions.add(first, {"thumbs": "up"})
    file = tmp_path / "outcomes.jsonl"
    file.write_bytes(file.read_bytes() + b'{"time": "2026", "task": "cu')
    second = executions.new_bag("cup")
    executions.add(second, {"corrections": "2"})
    for _ in range(3):
        executions.add(first, {"thumbs": "down"})
    assert file.read_bytes().count(b"down") == 1
    one, two = executions.all()
    assert dict(one.values) == {"outcome": "arrived", "corrections": "0", "thumbs": "down"}
    assert (one.model, one.corrected, two.corrected) == ("models/0001.npz", False, True)
    assert (first.name, second.name) == ("cup_0000", "cup_0001")


def test_only_what_was_added_is_read_again(tmp_path):
    executions, other = (Executions(tmp_path, lambda: NOON) for _ in range(2))
    first = executions.new_bag("cup")
    executions.add(first, {"outcome": "arrived"})
    assert len(executions.all()) == 1
    file = tmp_path / "outcomes.jsonl"
    file.write_bytes(b"x" * (file.stat().st_size - 1) + b"\n")
    other.add(first, {"thumbs": "up"})
    (one,) = executions.all()
    assert dict(one.values) == {"outcome": "arrived", "thumbs": "up"}
    file.write_bytes(b"")  # another file: nothing is known any more
    assert executions.all() == []


def test_old_recordings_go_and_what_became_of_them_stays(tmp_path):
    """Also when their numbers get longer."""
    executions = Executions(tmp_path, lambda: NOON)
    bags = [tmp_path / "executions/cup" / f"cup_{number}" for number in (9998, 9999, 10000)]
    for bag in bags:
        bag.mkdir(parents=True)
        executions.add(bag, {"outcome": "arrived"})
    assert executions.new_bag("cup").name == "cup_10001"
    executions.thin("cup", 2)
    assert [bag.exists() for bag in bags] == [False, True, True]
    shutil.rmtree(bags[0].parent)
    assert len(executions.all()) == 3 and executions.new_bag("cup").name == "cup_10001"


def test_executions_count_since_the_change_before_them():
    tasks = {"cup": 3, "plate": 2}
    changes = [
        Change("2026-01-01T10:00:00+00:00", START, "", "", "models/0001.npz", tasks),
        Change("2026-01-02T10:00:00+00:00", KEEP, "cup", "bags/cup/cup_0001_kept", "", tasks),
    ]
    values = [
        {"outcome": "arrived", "corrections": "1"},
        {"outcome": "arrived", "thumbs": "up", "spilled": "1"},
        {"outcome": "stopped: withdrawn", "thumbs": "down", "spilled": "4"},
    ]
    days = ("2026-01-01T23:00:00+02:00", "2026-01-03T00:00:00+00:00", "2026-01-04T00:00:00+00:00")
    executions = [
        Execution(day, "cup", f"executions/cup/cup_{k}", "", one)
        for k, (day, one) in enumerate(zip(days, values, strict=True))
    ]
    skills = skill_history(changes, executions[::-1])
    first, second = skills["cup"]
    assert (first.what, first.texts()) == ("the first model", ("1", "1", "1", "0", "0", "-"))
    assert (second.what, second.texts()) == ("kept 0001", ("2", "1", "0", "1", "1", "2.5"))
    assert [one.n_executions for one in skills["plate"]] == [0]
    (unknown,) = skill_history([], executions[:1])["cup"]
    assert (unknown.what, unknown.n_executions) == ("before", 1)


def controlled_end(library, task):
    means = library.weight_mean[task].reshape(-1, library.basis.n_basis)[library.n_observed :]
    return (library.basis.design_matrix(np.ones(1)) @ means.T)[0]

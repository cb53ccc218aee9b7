# SPDX-License-Identifier: Apache-2.0
"""A folder of tasks after a kill at any write: the old state or the new one, and it goes on."""

import json
import os
import shutil
import sys
import traceback

import numpy as np
import pytest
from corrected_execution import execute
from model_builder import make_dofs, perform, true_library, write_recording

from intent_recognition.durable import locked
from intent_recognition.errors import BagError, ResourceBusyError
from intent_recognition.learning import RuleChange
from intent_recognition.model import Executions, load_model, load_trained, task_folder
from intent_recognition.model.folder_content import is_correction, is_finished
from intent_recognition.model.history import standing
from intent_recognition.model.task_folder import HISTORY, LEARN, START, TaskFolder, now

DOFS = make_dofs()
TRUTH = true_library(DOFS)
WRITES = {"open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "shutil.move"}
DONE, KILLED = 0, 9


def record(folder, task, seed):
    return write_recording(folder.new_bag(TRUTH.labels[task]), perform(TRUTH, task, seed), DOFS)


@pytest.fixture(scope="module", autouse=True)
def margins_stay():
    """Margins take most of the time of learning, and nothing is written meanwhile."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task_folder, "with_margins", lambda trained: trained)
        yield


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """Two tasks of two recordings each, and one more recording that is not learned yet."""
    path = tmp_path_factory.mktemp("tasks") / "mine"
    folder = TaskFolder(path, DOFS)
    for k in range(2):
        for task in (0, 1):
            folder.learn(record(folder, task, 10 * task + k))
    record(folder, 0, 7)
    execute(folder, perform(TRUTH, 0, 1))
    return path


def state(path):
    """What a folder holds: what stands, its model, where its recordings are."""
    folder = TaskFolder(path, DOFS)
    changes = [(change.action, change.bag) for change in standing(folder.history())]
    counts = {}
    if folder.model_path.exists():
        counts = {label: s.n for label, s in load_trained(folder.model_path)[1].tasks.items()}
    homes = sorted(
        (str(p.relative_to(path)), is_finished(p))
        for home in ("bags", "undone")
        for p in path.glob(f"{home}/*/*")
    )
    known = [(one.bag, dict(one.values)) for one in Executions(path, now).all()]
    return changes, counts, homes, known


def act(path, action):
    folder = TaskFolder(path, DOFS)
    if action == "learn":
        folder.learn(folder.waiting()[0])
    elif action == "improve":
        task, practice = TRUTH.labels[0], path / "practice" / TRUTH.labels[0] / "practice_00"
        size = load_model(folder.model_path).library.regressions[0].matrix.shape
        change = RuleChange(np.zeros(size), np.full(size[0], 0.01))
        folder.improve(task, practice, change, folder.present_model())
    elif action in ("correct", "thumbs"):
        executions = Executions(path, now)
        bag = path / executions.all()[0].bag
        if action == "correct":
            folder.correct(bag)
        else:
            executions.add(bag, {"thumbs": "up"})
    elif action == "keep":
        folder.learn(next(bag for bag in folder.waiting() if is_correction(bag)))
    else:
        folder.undo()


def killed_at(path, action, k):
    """Run an action in a process that dies before its k-th write; returns its exit code."""
    pid = os.fork()
    if pid == 0:
        left = [k]

        def watch(event, arguments):
            if event not in WRITES or (event == "open" and not writes(arguments)):
                return
            if str(path) in str(arguments[0]):
                left[0] -= 1
                if left[0] == 0:
                    os._exit(KILLED)

        sys.addaudithook(watch)
        try:
            act(path, action)
            os._exit(DONE)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def writes(arguments):
    _, mode, flags = arguments
    return bool((mode and set(mode) & set("wax+")) or flags & (os.O_WRONLY | os.O_RDWR))


@pytest.mark.slow
@pytest.mark.parametrize(
    "actions",
    [
        ["learn"],
        ["undo"],
        ["improve"],
        ["improve", "undo"],
        ["correct"],
        ["correct", "keep"],
        ["correct", "keep", "undo"],
        ["thumbs"],
    ],
    ids=" ".join,
)
def test_killed_at_any_write_the_folder_is_the_old_or_the_new_one(started, tmp_path, actions):
    *earlier, action = actions
    started = shutil.copytree(started, tmp_path / "started")
    for one in earlier:
        act(started, one)
    old = state(shutil.copytree(started, tmp_path / "old"))
    done = shutil.copytree(started, tmp_path / "done")
    act(done, action)
    new = state(done)
    assert old != new
    found, k, code = [], 0, KILLED
    while code == KILLED:
        k += 1
        path = shutil.copytree(started, tmp_path / f"{k}")
        code = killed_at(path, action, k)
        after = state(path)
        assert after in (old, new), k
        found.append(after == new)
        if after == old:
            act(path, action)
            assert state(path) == new
    assert code == DONE
    assert k > (1 if action == "thumbs" else 5)
    assert found == sorted(found)  # once it has happened, it stays


def test_half_a_line_never_happened(started, tmp_path):
    text = (started / HISTORY).read_bytes()
    last = text[: text[:-1].rfind(b"\n") + 1]
    for cut in range(len(last) + 1, len(text) - 1, 25):
        path = shutil.copytree(started, tmp_path / f"{cut}")
        (path / HISTORY).write_bytes(text[:cut])
        folder = TaskFolder(path, DOFS)
        assert len(folder.history()) == 3
        assert json.loads((path / HISTORY).read_text().splitlines()[-1])
        assert sum(s.n for s in load_trained(folder.model_path)[1].tasks.values()) == 3


def test_damage_within_the_history_is_set_aside(started, tmp_path):
    path = shutil.copytree(started, tmp_path / "copy")
    lines = (path / HISTORY).read_bytes().splitlines(keepends=True)
    for bad in (b"\0\xff\n", b"[1]\n", b'{"time": 1}\n', b"[" * 9999 + b"\n"):
        (path / HISTORY).write_bytes(b"".join([*lines[:1], bad, *lines[1:]]))
        assert len(TaskFolder(path, DOFS).history()) == 4
    assert len((path / task_folder.DAMAGED).read_text().splitlines()) == 4


@pytest.mark.slow
def test_a_history_that_is_gone_begins_anew_with_the_model(started, tmp_path):
    path = shutil.copytree(started, tmp_path / "copy")
    (path / HISTORY).unlink()
    folder = TaskFolder(path, DOFS)
    assert [change.action for change in folder.history()] == [START]
    assert folder.waiting() == []  # it is not known what was learned
    change = folder.learn(record(folder, 1, 40))
    assert (change.action, change.tasks[TRUTH.labels[1]]) == (LEARN, 3)
    folder.undo()
    assert state(path)[1] == {TRUTH.labels[0]: 2, TRUTH.labels[1]: 2}


@pytest.mark.slow
def test_two_teachers_lose_nothing(started, tmp_path):
    path = shutil.copytree(started, tmp_path / "copy")
    first, second = TaskFolder(path, DOFS), TaskFolder(path, DOFS)
    bags = [record(first, k % 2, 60 + k) for k in range(6)]
    pids = []
    for own in (bags[:3], bags[3:]):
        pid = os.fork()
        if pid == 0:
            try:
                teacher = TaskFolder(path, DOFS)
                for bag in own:
                    teacher.learn(bag)
                os._exit(0)
            except BaseException:
                traceback.print_exc()
                os._exit(1)
        pids.append(pid)
    assert [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in pids] == [0, 0]
    assert sum(state(path)[1].values()) == 10
    again = second.learn(bags[0])
    assert again.bag == bags[0].relative_to(path).as_posix()
    assert sum(state(path)[1].values()) == 10


def test_a_folder_in_use_is_told(tmp_path):
    seconds = iter(range(100))
    lock = tmp_path / ".lock"
    with (
        locked(lock),
        pytest.raises(ResourceBusyError, match="another process"),
        locked(lock, 3.0, lambda: next(seconds)),
    ):
        pass


@pytest.mark.parametrize(
    "label", ["", "a/b", "..", ".a", "-a", "none", "x" * 300, "a\x1b[2J", "a\n", " a", "a\u202eb"]
)
def test_a_label_that_cannot_name_a_folder_is_refused(tmp_path, label):
    with pytest.raises(BagError, match="label"):
        TaskFolder(tmp_path, DOFS).new_bag(label)

# SPDX-License-Identifier: Apache-2.0
"""Practice of taught tasks in a task folder.

    my_tasks/practice/give_cup/practice_00/
      practice.json, rollouts/...   see `improvement.PracticeSession`
      trial.npz                     the model being tried while a person judges executions

Accepted practice is a change in the history, with the number of the new model. Its session is then
closed; undoing the change moves it to `undone`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from intent_recognition.errors import ModelError, ResourceBusyError
from intent_recognition.improvement import (
    STATE,
    Cost,
    CovarianceSearch,
    PracticeSession,
    TaskPractice,
)
from intent_recognition.learning import change_rule
from intent_recognition.model.file import Model, load_trained, save_model
from intent_recognition.model.folder_content import LIBRARY_MODEL
from intent_recognition.model.history import IMPROVE, Change, standing
from intent_recognition.model.task_folder import PRACTICE, UNDONE, TaskFolder

TRIAL = "trial.npz"


class PractisedTask:
    """A task of a folder for practice; further options are those of `TaskPractice`.

    Raises:
        ModelError: the folder has no model yet.
        ArgumentError: the task cannot be practised.
    """

    def __init__(
        self,
        folder: TaskFolder,
        task: str,
        *,
        beside_m: Sequence[float] | None = None,
        moved_m: Sequence[float] = (0.0, 0.0, 0.0),
        **options: Any,
    ) -> None:
        if not folder.model_path.exists():
            cure = "Teach a task first, or name the folder of tasks."
            raise ModelError.about(str(folder.path), f"a folder with {LIBRARY_MODEL}", "none", cure)
        self.folder, self.task, self.since = folder, task, folder.present_model()
        self._model, self._trained = load_trained(folder.model_path)
        options |= {"beside_m": beside_m, "moved_m": moved_m}
        self.practice = TaskPractice(self._trained, self._model.dofs, task, **options)
        self._about = {"task": task, "beside": _text(beside_m or ()), "moved": _text(moved_m)}

    def session(self, cost: Cost, seed: int) -> PracticeSession:
        """Continue the practice with this cost and seed, or start a new one."""
        home = self.folder.path / PRACTICE / self.task
        closed = {change.bag for change in standing(self.folder.history())}
        search = CovarianceSearch(self.practice.space.n_axes, seed, self.practice.step)
        about: dict[str, str | int] = {**self._about, "seed": seed}
        begun = [*home.glob("practice_[0-9]*")]
        for place in sorted(begun, key=lambda one: ((one / STATE).exists(), one), reverse=True):
            if place.relative_to(self.folder.path).as_posix() in closed:
                continue
            try:
                return PracticeSession(place, self.practice, search, cost, about)
            except ResourceBusyError:
                continue  # practice with another cost or seed
        undone = self.folder.path / UNDONE / self.task
        used = {path.name for path in (*begun, *undone.glob("practice_[0-9]*"))}
        number = next(n for n in range(len(used) + 1) if f"practice_{n:02d}" not in used)
        return PracticeSession(home / f"practice_{number:02d}", self.practice, search, cost, about)

    def accept(self, session: PracticeSession) -> Change:
        """Change the model to the result of practice.

        Raises:
            ModelError: there is no improvement, or the model has changed since practice began.
        """
        change = self.practice.change(session.settled())
        return self.folder.improve(self.task, session.folder, change, self.since)

    def write_trial(self, session: PracticeSession) -> Path:
        """Write the model with the point to try next; return its file."""
        weights = self.practice.space.weights(session.next())
        tried = change_rule(self._trained, self.task, self.practice.change(weights))
        path = session.folder / TRIAL
        save_model(path, Model(tried.library, self._model.dofs), tried)
        return path


def _text(numbers: Sequence[float]) -> str:
    return " ".join(f"{number:g}" for number in numbers)


def undo_practice(folder: TaskFolder, task: str) -> Change:
    """Undo the last accepted practice of a task.

    Raises:
        ModelError: the last change is a different one.
    """
    kept = standing(folder.history())
    last = kept[-1] if kept else None
    if last is None or (last.action, last.task) != (IMPROVE, task):
        got = "none" if last is None else f"{last.action} {last.task}".strip()
        cure = "`intent undo` takes the last change back, whatever it is."
        raise ModelError.about("undo", f"practice of {task} as the last change", got, cure)
    return folder.undo()

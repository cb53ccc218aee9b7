# SPDX-License-Identifier: Apache-2.0
"""The library of tasks as a folder that a person can read: recordings, model, history.

    my_tasks/
      model.npz              what the nodes load
      history.jsonl          one line per change: when, what, which recording, tasks since
      bags/give_cup/give_cup_00, ...   the recordings, by task
      undone/...             recordings that were taken back; nothing recorded is ever lost
      models/0001.npz, ...   the model after each change, to go back to

A recording is learned by adding its statistics to the model (`learning.add_statistics`), in
milliseconds; a folder without a model learns from all its recordings once there are enough. How
much evidence against `none` counts is learned again while tasks have few recordings.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import (
    BagError,
    ModelError,
    ResourceBusyError,
    TrainingError,
    describe,
)
from intent_recognition.learning import (
    Trained,
    TrainingSettings,
    add_statistics,
    is_outdated,
    learn_accumulated,
    with_margin,
)
from intent_recognition.model.file import Model, check_dofs, load_model, load_trained, save_model
from intent_recognition.model.from_bags import FromBags, accumulate_bags

MODEL, HISTORY = "model.npz", "history.jsonl"
BAGS, UNDONE, MODELS = "bags", "undone", "models"
START, LEARN, WAIT, UNDO = "start", "learn", "wait", "undo"
FORBIDDEN = frozenset("/\\\0")


def _now() -> datetime:
    return datetime.now().astimezone()


@dataclass(frozen=True)
class Change:
    """One line of the history.

    Attributes:
        time: ISO 8601, local time with its offset.
        action: "start" (a model to begin with), "learn", "wait" (recorded, too few yet to learn
            from) or "undo".
        task: label of the recording, empty where there is none.
        bag: the recording, relative to the folder, empty where there is none.
        model: the model since then, relative to the folder, empty where there is none yet.
        tasks: demonstrations per task of that model.
    """

    time: str
    action: str
    task: str
    bag: str
    model: str
    tasks: Mapping[str, int]


class TaskFolder:
    """A library of tasks on disk that grows by one recording at a time.

    Args:
        path: the folder; made if it is missing.
        dofs: what is observed and controlled; must be the model's, once there is one.
        clock: tells the time for the history.

    Raises:
        ResourceBusyError: the folder cannot be made.
        DofError: the model in the folder has other DOFs.
    """

    def __init__(self, path: str | Path, dofs: DofSpec, clock: Callable[[], datetime] = _now):
        self.path = Path(path).absolute()
        self.dofs = dofs
        self._clock = clock
        try:
            for name in (BAGS, MODELS):
                (self.path / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            cure = "Choose another folder."
            raise ResourceBusyError(
                describe(str(self.path), "a folder that can be made", error, cure)
            ) from error
        if self.model_path.exists():
            check_dofs(load_model(self.model_path), dofs, "the DOFs asked for")

    @property
    def model_path(self) -> Path:
        """The present model; it is not there before anything was learned."""
        return self.path / MODEL

    def history(self) -> list[Change]:
        """All changes, the oldest first."""
        file = self.path / HISTORY
        if not file.exists():
            return []
        return [Change(**json.loads(line)) for line in file.read_text("utf-8").splitlines()]

    def start_from(self, model: str | Path) -> None:
        """Begin with a model that was trained elsewhere.

        Raises:
            ModelError: it holds no statistics to add to.
            DofError: it has other DOFs.
            ResourceBusyError: the folder has a model already.
        """
        if self.model_path.exists():
            cure = "Choose a new folder, or leave the model out."
            raise ResourceBusyError(describe("model", "a folder without one", self.path, cure))
        loaded, trained = load_trained(model)
        check_dofs(loaded, self.dofs, "the DOFs asked for")
        self._keep(START, "", "", trained)

    def new_bag(self, task: str) -> Path:
        """Directory for the next recording of a task; nothing is made yet.

        Raises:
            BagError: the label cannot be the name of a folder, or means no task.
        """
        if not task or task.startswith(".") or task == "none" or FORBIDDEN & set(task):
            cure = "Give a label such as give_cup."
            raise BagError(describe("task", "a label that can name a folder", repr(task), cure))
        used = {p.name for home in (BAGS, UNDONE) for p in (self.path / home / task).glob("*")}
        number = next(n for n in range(len(used) + 1) if f"{task}_{n:02d}" not in used)
        return self.path / BAGS / task / f"{task}_{number:02d}"

    def learn(self, bag: Path) -> Change:
        """Add one recording of this folder to the model.

        Returns:
            What changed; its action is "wait" where a first model needs more recordings.

        Raises:
            BagError: the recording cannot be read.
            TrainingError: it cannot be learned from; it is moved to `undone`.
        """
        task = bag.parent.name
        try:
            trained = self._more(bag) if self.model_path.exists() else self._first()
        except (BagError, TrainingError):
            self.prune(bag)
            raise
        return self._keep(LEARN if trained else WAIT, task, self._relative(bag), trained)

    def undo(self) -> Change:
        """Take the last recording back: the model before it returns, the bag goes to `undone`.

        Raises:
            ModelError: there is nothing to take back.
        """
        kept = self._standing()
        if not kept or kept[-1].action not in (LEARN, WAIT):
            cure = "Only recordings made in this folder can be taken back."
            raise ModelError(describe("undo", "a recording to take back", "none", cure))
        last, before = kept[-1], kept[-2] if len(kept) > 1 else None
        self.prune(self.path / last.bag)
        if before is not None and before.model:
            _copy(self.path / before.model, self.model_path)
        else:
            self.model_path.unlink(missing_ok=True)
        return self._write(
            UNDO,
            last.task,
            last.bag,
            before.model if before else "",
            before.tasks if before else {},
        )

    def prune(self, bag: Path) -> None:
        """Move a recording to `undone`."""
        target = self.path / UNDONE / bag.parent.name / bag.name
        target.parent.mkdir(parents=True, exist_ok=True)
        if bag.exists():
            shutil.move(bag, target)

    def _standing(self) -> list[Change]:
        """The changes that were not taken back."""
        kept: list[Change] = []
        for change in self.history():
            if change.action == UNDO:
                kept.pop()
            else:
                kept.append(change)
        return kept

    def _more(self, bag: Path) -> Trained:
        model, trained = load_trained(self.model_path)
        preprocessing = trained.preprocessing
        found = accumulate_bags(
            [bag], model.dofs, preprocessing.settings, preprocessing=preprocessing
        )
        _check(found, bag)
        more = add_statistics(trained, found.accumulated.tasks, found.accumulated.used)
        before, now = ({label: s.n for label, s in t.tasks.items()} for t in (trained, more))
        if not is_outdated(before, now):
            return more
        return with_margin(more)

    def _first(self) -> Trained | None:
        """Learn from all recordings, if there are enough by now."""
        found = accumulate_bags([self.path / BAGS], self.dofs, TrainingSettings())
        _check(found, self.path / BAGS)
        if found.accumulated.n_used == len(found.accumulated.tasks):
            return None
        return learn_accumulated(found.accumulated).trained

    def _keep(self, action: str, task: str, bag: str, trained: Trained | None) -> Change:
        if trained is None:
            return self._write(action, task, bag, "", {})
        numbers = [int(p.stem) for p in (self.path / MODELS).glob("*.npz") if p.stem.isdigit()]
        copy = self.path / MODELS / f"{max(numbers, default=0) + 1:04d}.npz"
        save_model(copy, Model(trained.library, self.dofs), trained)
        _copy(copy, self.model_path)
        counts = {label: statistics.n for label, statistics in trained.tasks.items()}
        return self._write(action, task, bag, self._relative(copy), counts)

    def _write(
        self, action: str, task: str, bag: str, model: str, tasks: Mapping[str, int]
    ) -> Change:
        now = self._clock().isoformat(timespec="milliseconds")
        change = Change(now, action, task, bag, model, dict(tasks))
        with (self.path / HISTORY).open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(change)) + "\n")
        return change

    def _relative(self, path: Path) -> str:
        return path.absolute().relative_to(self.path).as_posix()


def _check(found: FromBags, bag: Path) -> None:
    """Say why nothing of a recording can be used."""
    if found.accumulated.n_used:
        return
    reasons = [str(r) for r in found.rejections] + [r for _, r in found.accumulated.rejected]
    raise TrainingError(
        describe(
            bag.name,
            "a recording of one movement, at rest before and after",
            "; ".join(reasons[:3]) or "nothing",
            "Record it again; this one is kept in `undone`.",
        )
    )


def _copy(source: Path, target: Path) -> None:
    """Copy a file so that the target is whole at every moment."""
    part = target.with_suffix(".part")
    shutil.copyfile(source, part)
    part.replace(target)

# SPDX-License-Identifier: Apache-2.0
"""A library of tasks as a readable folder of recordings, models and a history.

    my_tasks/
      model.npz              present model, which the nodes load
      history.jsonl          one line per change: time, action, recording, tasks since then
      bags/give_cup/give_cup_00, ...   the recordings, by task
      undone/...             undone recordings; no recording is ever deleted
      models/0001.npz, ...   the model after each change, for undo
      practice/give_cup/practice_00, ...   practice, see `practised`
      executions/, outcomes.jsonl   see `executions`

Learning a recording adds its statistics to the model (`learning.add_statistics`), in milliseconds;
a folder without a model learns from all recordings once there are enough. While tasks have few
recordings, the weight of evidence against `none` is learned again, too.
"""

import filecmp
import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
from datetime import datetime
from functools import partial
from pathlib import Path

from intent_recognition.bags import BagReader
from intent_recognition.demonstrations import (
    CORRECTED,
    DofSpec,
    check_label,
    settle_orientations,
    write_corrected,
)
from intent_recognition.durable import append_line, copy, locked, sync_folder, write_text
from intent_recognition.errors import BagError, ModelError, ResourceBusyError, TrainingError
from intent_recognition.learning import (
    RuleChange,
    Trained,
    TrainingSettings,
    add_statistics,
    change_rule,
    is_outdated,
    learn_accumulated,
    move_task,
    with_margins,
)
from intent_recognition.model.file import Model, check_dofs, load_model, load_trained, save_model
from intent_recognition.model.folder_content import (
    LIBRARY_MODEL,
    check_usable,
    is_correction,
    is_finished,
)
from intent_recognition.model.from_bags import accumulate_bags, with_frames
from intent_recognition.model.history import (
    HISTORY,
    IMPROVE,
    KEEP,
    LEARN,
    START,
    UNDO,
    WAIT,
    Change,
    history_lines,
    read_history,
    standing,
    undoable,
)

BAGS, UNDONE, MODELS, PRACTICE = "bags", "undone", "models", "practice"
DAMAGED, LOCK, UNFINISHED = "history.damaged", ".lock", "unfinished"
METADATA = "metadata.yaml"


def now() -> datetime:
    """Local time with its offset."""
    return datetime.now().astimezone()


class TaskFolder:
    """A library of tasks on disk that grows by one recording at a time; creates the folder.

    `dofs` must match the model's, if there is one; `clock` gives the times in the history.

    Attributes:
        doubts: what is doubtful in the recordings that were learned last, each in a sentence.

    Raises:
        ResourceBusyError: the folder cannot be created.
        DofError: the model in the folder has other DOFs.
    """

    def __init__(self, path: str | Path, dofs: DofSpec, clock: Callable[[], datetime] = now):
        self.path = Path(path).absolute()
        self.dofs, self.doubts = dofs, tuple[str, ...]()
        self._clock = clock
        try:
            for name in (BAGS, MODELS):
                (self.path / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            cure = "Choose another folder."
            expected = "a folder that can be made"
            raise ResourceBusyError.about(str(self.path), expected, error, cure) from error
        with self._locked():
            pass
        if self.model_path.exists():
            self.dofs = check_dofs(load_model(self.model_path), dofs, "the DOFs asked for")

    @property
    def model_path(self) -> Path:
        """Path of the present model, which exists only once something was learned."""
        return self.path / LIBRARY_MODEL

    def history(self) -> list[Change]:
        """All changes, oldest first."""
        return read_history(self.path)

    def waiting(self) -> list[Path]:
        """Complete recordings that were neither learned nor undone, by name."""
        if (self.path / DAMAGED).exists():
            return []  # unknown which ones were learned
        known = {change.bag for change in self.history()}
        bags = sorted(path.parent for path in (self.path / BAGS).glob(f"*/*/{METADATA}"))
        return [bag for bag in bags if self._relative(bag) not in known and is_finished(bag)]

    def start_from(self, model: str | Path) -> None:
        """Start with an existing model that was trained elsewhere.

        Raises:
            ModelError: the model holds no statistics to add to.
            DofError: the model has other DOFs.
            ResourceBusyError: the folder already has a model.
        """
        with self._locked():
            if self.model_path.exists():
                cure = "Choose a new folder, or leave the model out."
                expected = "a folder without a model"
                raise ResourceBusyError.about("model", expected, self.model_path, cure)
            loaded, trained = load_trained(model)
            self.dofs = check_dofs(loaded, self.dofs, "the DOFs asked for")
            self._keep(START, "", "", trained)

    def began_with(self, model: str | Path) -> bool:
        """Whether a model equals the one the folder started with, or the present one."""
        began = [self.path / change.model for change in self.history() if change.action == START]
        return any(_same(Path(model), one) for one in (*began, self.model_path) if one.is_file())

    def new_bag(self, task: str) -> Path:
        """Directory for the next recording of a task; it is not created.

        Raises:
            BagError: the label cannot be a folder name, or does not name a task.
        """
        check_label(task)
        used = {p.name for home in (BAGS, UNDONE) for p in (self.path / home / task).glob("*")}
        number = next(n for n in range(len(used) + 1) if f"{task}_{n:02d}" not in used)
        return self.path / BAGS / task / f"{task}_{number:02d}"

    def learn(self, bag: Path) -> Change:
        """Add one recording of this folder to the model; a correction changes its task.

        Returns:
            The change; its action is "wait" if a first model needs more recordings.

        Raises:
            BagError: the recording cannot be read.
            TrainingError: nothing can be learned from it; it is moved to `undone`.
        """
        task, name = bag.parent.name, self._relative(bag)
        with self._locked():
            for change in standing(self.history()):
                if change.bag == name:  # another teacher was faster
                    return change
            self.doubts = ()
            try:
                trained = self._more(bag) if self.model_path.exists() else self._first(bag)
            except (BagError, TrainingError):
                self.prune(bag)
                raise
            learned = KEEP if self.model_path.exists() and is_correction(bag) else LEARN
            return self._keep(learned if trained else WAIT, task, name, trained)

    def improve(self, task: str, practice: Path, change: RuleChange, since: str) -> Change:
        """Change the rule of a task to the result of practice, whose folder is inside this one.

        Raises:
            ModelError: the model is no longer `since`, with which practice began.
        """
        with self._locked():
            if not since or self.present_model() != since:
                cure = "Practise again, with the present model."
                got = f"{self.present_model() or 'none'}, after practice with {since or 'none'}"
                raise ModelError.about("model", "the model that was practised", got, cure)
            _, trained = load_trained(self.model_path)
            changed = change_rule(trained, task, change)
            return self._keep(IMPROVE, task, self._relative(practice), changed)

    def undo(self) -> Change:
        """Undo the last change: restore the model before it and move its bag to `undone`.

        Raises:
            ModelError: there is nothing to undo.
        """
        with self._locked():
            history = self.history()
            last = undoable(history)
            if last is None:
                cure = "Only changes made in this folder can be taken back."
                raise ModelError.about("undo", "a change to take back", "none", cure)
            before = next(iter(standing(history)[-2:-1]), None)
            if before is not None and before.model and not (self.path / before.model).is_file():
                cure = "Put it back, or go on with the present model."
                raise ModelError.about(before.model, "the model before", "none", cure)
            model, tasks = (before.model, before.tasks) if before else ("", {})
            return self._write(UNDO, last.task, last.bag, model, tasks)

    def correct(self, execution: Path) -> Path:
        """Make a demonstration from a corrected execution; return its recording.

        Raises:
            BagError: the execution was not corrected.
            ResourceBusyError: the correction was kept before.
        """
        target, unfinished = (self.path / home / _kept(execution) for home in (BAGS, UNFINISHED))
        labels = BagReader(execution, tolerant=True).custom_data
        with self._locked():
            if target.exists():
                wanted, cure = "an execution that was not kept", "Lead the arm by hand once more."
                raise ResourceBusyError.about(str(execution), wanted, target, cure)
            write_corrected(execution, unfinished, labels | {CORRECTED: self._relative(execution)})
            target.parent.mkdir(parents=True, exist_ok=True)
            unfinished.rename(target)
            sync_folder(target.parent)
        return target

    def was_kept(self, execution: Path) -> bool:
        """Whether a demonstration was ever made from an execution, even if it was undone."""
        return any((self.path / home / _kept(execution)).exists() for home in (BAGS, UNDONE))

    def present_model(self) -> str:
        """Model of the last change, relative to the folder; empty if there is none."""
        changes = self.history()
        return changes[-1].model if changes else ""

    def prune(self, bag: Path) -> None:
        """Move a recording to `undone`."""
        target = self.path / UNDONE / bag.parent.name / bag.name
        target.parent.mkdir(parents=True, exist_ok=True)
        if bag.exists():
            shutil.move(bag, target)
            sync_folder(target.parent)

    def _more(self, bag: Path) -> Trained:
        model, trained = load_trained(self.model_path)
        dofs, how = replace(model.dofs, extrinsics=self.dofs.extrinsics), trained.preprocessing
        read = partial(accumulate_bags, dofs=dofs, settings=how.settings, preprocessing=how)
        found = read([bag])
        check_usable(found, bag)
        if is_correction(bag):
            known = [read([kept]) for kept in self._kept_of(bag.parent.name)]
            tasks = [task for one in (*known, found) for task in one.accumulated.tasks.values()]
            *earlier, corrected = (example for task in tasks for example in task.examples)
            return with_frames(move_task(trained, corrected, earlier), found.frames)
        new = found.accumulated
        more = with_frames(add_statistics(trained, new.tasks, new.used), found.frames)
        self.doubts = tuple(map(str, found.doubts(more)))
        before, now = ({label: s.n for label, s in t.tasks.items()} for t in (trained, more))
        return with_margins(more) if is_outdated(before, now) else more

    def _kept_of(self, task: str) -> list[Path]:
        """The newest corrections of a task that are in force, oldest first."""
        kept = [change for change in standing(self.history()) if change.action == KEEP]
        bags = [self.path / change.bag for change in kept if change.task == task]
        return [bag for bag in bags[-10:] if bag.exists()]  # reading each takes about 50 ms

    def _first(self, bag: Path) -> Trained | None:
        """Learn from this and all waiting recordings; None if there are still too few."""
        waited = [self.path / change.bag for change in standing(self.history())]
        bags = [*filter(Path.exists, waited), bag]
        self.dofs = settle_orientations(self.dofs, bags)
        found = accumulate_bags(bags, self.dofs, TrainingSettings())
        check_usable(found, self.path / BAGS)
        if found.accumulated.n_used == len(found.accumulated.tasks):
            return None
        trained = learn_accumulated(found.accumulated).trained
        self.doubts = tuple(map(str, found.doubts(trained)))
        return with_frames(trained, found.frames)

    def _keep(self, action: str, task: str, bag: str, trained: Trained | None) -> Change:
        if trained is None:
            return self._write(action, task, bag, "", {})
        numbers = [int(p.stem) for p in (self.path / MODELS).glob("*.npz") if p.stem.isdigit()]
        kept = self.path / MODELS / f"{max(numbers, default=0) + 1:04d}.npz"
        save_model(kept, Model(trained.library, self.dofs), trained)
        counts = {label: statistics.n for label, statistics in trained.tasks.items()}
        return self._write(action, task, bag, self._relative(kept), counts)

    def _write(
        self, action: str, task: str, bag: str, model: str, tasks: Mapping[str, int]
    ) -> Change:
        at = self._clock().isoformat(timespec="milliseconds")
        change = Change(at, action, task, bag, model, dict(tasks))
        append_line(self.path / HISTORY, json.dumps(asdict(change)))
        self._follow()
        return change

    def _follow(self) -> None:
        """Make model and recordings agree with the history.

        A change is committed by its line in the history. A crash before it changes nothing; work
        after it is completed at the next start.
        """
        changes = self.history()
        bags = {change.bag for change in standing(changes)}
        for change in changes:
            if change.action == UNDO and change.bag not in bags:
                self.prune(self.path / change.bag)
        if not changes:
            return
        model = changes[-1].model
        if not model:
            self.model_path.unlink(missing_ok=True)
            sync_folder(self.path)
        elif (self.path / model).is_file() and not _same(self.path / model, self.model_path):
            copy(self.path / model, self.model_path)

    def _recover(self) -> None:
        """Recover from a crash at any instant; recordings are never removed."""
        for part in (*self.path.glob("*.part"), *(self.path / MODELS).glob("*.part")):
            part.unlink()
        shutil.rmtree(self.path / UNFINISHED, ignore_errors=True)  # copies, see `correct`
        lines = history_lines(self.path)
        if any(change is None for _, change in lines):
            damaged = [line for line, change in lines[:-1] if change is None]
            for line in damaged:  # an incomplete last line never happened
                append_line(self.path / DAMAGED, line)
            whole = "".join(f"{line}\n" for line, change in lines if change is not None)
            write_text(self.path / HISTORY, whole)
        if not self.history():
            self._derive()
        referred = [Path(change.model).stem for change in self.history()]
        last = max((int(stem) for stem in referred if stem.isdigit()), default=None)
        for model in (self.path / MODELS).glob("*.npz"):
            if last is not None and model.stem.isdigit() and int(model.stem) > last:
                model.unlink()
        self._follow()

    def _derive(self) -> None:
        """Start a new history with the present model if the history was lost."""
        models = sorted((self.path / MODELS).glob("*.npz"))
        if not models:
            return
        present = self.model_path if self.model_path.exists() else models[-1]
        if present != self.model_path and not (self.path / DAMAGED).exists():
            return  # the first model was being written
        append_line(self.path / DAMAGED, "the history was lost")
        self._keep(START, "", "", load_trained(present)[1])

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Lock the folder against changes by other teachers, and recover it first."""
        with locked(self.path / LOCK):
            self._recover()
            yield

    def _relative(self, path: Path) -> str:
        return path.absolute().relative_to(self.path).as_posix()


def _kept(execution: Path) -> Path:
    """Path, below a folder of bags, of the demonstration made from an execution."""
    return Path(execution.parent.name) / f"{execution.name}_kept"


def _same(one: Path, other: Path) -> bool:
    return other.is_file() and filecmp.cmp(one, other, shallow=False)

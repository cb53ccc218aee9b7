# SPDX-License-Identifier: Apache-2.0
"""What became of each execution of a task, and so how each task has done over time.

Executions are kept in the folder of tasks beside their recordings.

    my_tasks/
      outcomes.jsonl                                 one line per thing that became known
      executions/give_cup/give_cup_0000, ...         the newest recordings of each task

A line is written once, at the end of the file, and on the disk before anything goes on. One that
was not written to its end never happened. Later lines add to, or change, what is known of the same
recording.
"""

import json
import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from intent_recognition.demonstrations import check_label
from intent_recognition.durable import append_line, writing
from intent_recognition.model.history import (
    IMPROVE,
    LEARN,
    START,
    UNDO,
    WAIT,
    Change,
    are_texts,
    is_inside,
)
from intent_recognition.untrusted import UntrustedError, load_json, read_log

EXECUTIONS, OUTCOMES = "executions", "outcomes.jsonl"
OUTCOME, CORRECTIONS, THUMBS, SPILLED = "outcome", "corrections", "thumbs", "spilled"
ARRIVED, UP, DOWN = "arrived", "up", "down"
MOST_VALUES, LONGEST_VALUE = 50, 200
"""Values of an execution, and characters of each, that are kept. Convention."""


@dataclass(frozen=True)
class Execution:
    """What is known of one execution, which ended at a time (ISO 8601)."""

    time: str
    task: str
    bag: str  # the recording, relative to the folder; an old one may have been removed
    # what the task was like then: the model in the folder, relative to it; empty where the folder
    # had none
    model: str
    # by name: `outcome`, `corrections`, `thumbs` (`up`, `down`), `spilled` and others
    values: Mapping[str, str]

    @property
    def corrected(self) -> bool:
        """Whether a person led the arm elsewhere."""
        return self.number(CORRECTIONS) > 0.0

    def number(self, name: str) -> float:
        """A value as a number; 0 where it is none."""
        try:
            return float(self.values.get(name, 0.0))
        except ValueError:
            return 0.0


class Executions:
    """The executions in a folder of tasks."""

    def __init__(self, path: Path, clock: Callable[[], datetime]):
        self.path, self._clock = path, clock
        self._known: dict[str, Execution] = {}
        self._read_to = 0

    def all(self) -> list[Execution]:
        """Every execution that something is known of, the oldest first.

        Only what was added since the last time is read.
        """
        for line in self._new_lines():
            one = _execution(line) if line else None
            if one is None:
                continue
            known = self._known.get(one.bag)
            values = one.values if known is None else {**known.values, **one.values}
            self._known[one.bag] = replace(known or one, values=values)
        return list(self._known.values())

    def _new_lines(self) -> list[str]:
        """The whole lines that were added since the last time; all of a file that is shorter."""
        file = self.path / OUTCOMES
        size = file.stat().st_size if file.exists() else 0
        if size < self._read_to:
            self._known, self._read_to = {}, 0
        if size == self._read_to:
            return []
        added = read_log(file, self._read_to)
        whole = added[: added.rfind(b"\n") + 1]
        self._read_to += len(whole)
        return whole.decode(errors="replace").split("\n")

    def new_bag(self, task: str) -> Path:
        """Where the next execution of a task is to be recorded.

        Raises:
            BagError: the label names no task.
        """
        check_label(task)
        names = [p.name for p in (self.path / EXECUTIONS / task).glob("*")]
        names += [Path(one.bag).name for one in self.all() if one.task == task]
        number = max((_number(Path(name)) for name in names), default=-1) + 1
        return self.path / EXECUTIONS / task / f"{task}_{number:04d}"

    def add(self, bag: Path, values: Mapping[str, str], model: str = "") -> None:
        """Note something about an execution, unless it is known.

        Raises:
            ResourceBusyError: it cannot be written.
        """
        kept = {str(k)[:LONGEST_VALUE]: str(v)[:LONGEST_VALUE] for k, v in values.items()}
        kept = dict(list(kept.items())[:MOST_VALUES])
        now = self._clock().isoformat(timespec="milliseconds")
        name = bag.relative_to(self.path).as_posix()
        if any(one.bag == name and kept.items() <= one.values.items() for one in self.all()):
            return
        line = Execution(now, bag.parent.name, name, model, kept)
        file = self.path / OUTCOMES
        with writing(str(file)):
            append_line(file, ("\n" if _is_torn(file) else "") + json.dumps(asdict(line)))

    def thin(self, task: str, most: int) -> None:
        """Remove the oldest recordings of a task; what became of them stays known."""
        found = sorted((self.path / EXECUTIONS / task).glob("*_[0-9]*"), key=_number)
        for bag in found[: max(len(found) - most, 0)]:
            shutil.rmtree(bag, ignore_errors=True)


def _number(bag: Path) -> int:
    """The number at the end of a recording's name; -1 where there is none."""
    end = bag.name.rpartition("_")[2]
    return int(end) if end.isdecimal() else -1


def _is_torn(file: Path) -> bool:
    """Whether a file's last line was not written to its end."""
    if not file.exists() or not file.stat().st_size:
        return False
    with file.open("rb") as stream:
        stream.seek(-1, os.SEEK_END)
        return stream.read() != b"\n"


def _execution(line: str) -> Execution | None:
    """The execution of a line, None where it is not a whole one."""
    try:
        found = Execution(**load_json(line))
    except (TypeError, UntrustedError):
        return None
    texts = (found.time, found.task, found.bag, found.model)
    if not are_texts(texts) or not isinstance(found.values, dict):
        return None
    known = are_texts(found.values) and are_texts(found.values.values())
    return found if known and is_inside(found.bag) and is_inside(found.model) else None


SKILL_COLUMNS = ("executions", "arrived", "corrected", "thumbs up", "thumbs down", "spilled")
TO_UNDO, TO_KEEP = "to undo", "to keep"
"""Keys on `teach/skills` of the change that an undo takes back, and of one that has a correction to
be kept."""
WAITING = "recordings that wait"
"""Key of the diagnostics of `task_teacher`: how many recordings are not learned yet."""


class SkillPeriod(NamedTuple):
    """A task between two of its changes."""

    task: str
    since: str  # when it began, ISO 8601; empty: with the first execution
    what: str  # the change, in words
    model: str  # the model since then, relative to the folder
    n_demonstrations: int
    n_executions: int = 0
    n_arrived: int = 0
    n_corrected: int = 0  # executions that a person corrected by hand; n_up and n_down liked or not
    n_up: int = 0
    n_down: int = 0
    spilled: float | None = None  # mean of those of which that is known; None: of none

    def texts(self) -> tuple[str, ...]:
        """The numbers of `SKILL_COLUMNS`, for people."""
        n = self.n_executions
        counts = (self.n_arrived, self.n_corrected, self.n_up, self.n_down)
        shown = [f"{one}" for one in counts] if n else ["-"] * len(counts)
        return (str(n), *shown, "-" if self.spilled is None else f"{self.spilled:.2g}")


def skill_history(
    changes: Sequence[Change], executions: Sequence[Execution]
) -> dict[str, list[SkillPeriod]]:
    """The periods of each task, the oldest first, from changes in that order and any executions.

    An execution belongs to the last change of its task before it. Where a change was taken back,
    that is a period of its own.
    """
    found: dict[str, list[SkillPeriod]] = {}
    for change in changes:
        labels = change.tasks if change.action == START else (change.task,)
        for label in labels:
            if label:
                n = int(change.tasks.get(label, 0))
                period = SkillPeriod(label, change.time, _words(change), change.model, n)
                found.setdefault(label, []).append(period)
    for label in {one.task for one in executions}:
        found.setdefault(label, [])
    return {label: _counted(label, found[label], executions) for label in sorted(found)}


def _counted(
    label: str, periods: list[SkillPeriod], executions: Sequence[Execution]
) -> list[SkillPeriod]:
    """The periods of a task with what became of its executions."""
    own = sorted((one for one in executions if one.task == label), key=lambda one: _at(one.time))
    if own and (not periods or _at(own[0].time) < _at(periods[0].since)):
        periods = [SkillPeriod(label, "", "before", "", 0), *periods]
    limits = [_at(period.since) for period in periods[1:]] + [float("inf")]
    counted, rest = [], own
    for period, until in zip(periods, limits, strict=True):
        here = [one for one in rest if _at(one.time) < until]
        rest = rest[len(here) :]
        spilled = [one.number(SPILLED) for one in here if SPILLED in one.values]
        thumbs = [one.values.get(THUMBS) for one in here]
        counted.append(
            period._replace(
                n_executions=len(here),
                n_arrived=sum(one.values.get(OUTCOME) == ARRIVED for one in here),
                n_corrected=sum(one.corrected for one in here),
                n_up=thumbs.count(UP),
                n_down=thumbs.count(DOWN),
                spilled=sum(spilled) / len(spilled) if spilled else None,
            )
        )
    return counted


def _words(change: Change) -> str:
    name = change.bag.rpartition("/")[2].removeprefix(f"{change.task}_")
    said = {
        START: "the first model",
        LEARN: f"learned {name}",
        WAIT: f"recorded {name}",
        UNDO: f"took {name} back",
        IMPROVE: f"improved by {name}",
    }
    return said.get(change.action, f"kept {name.removesuffix('_kept')}")


def _at(time: str) -> float:
    """Seconds of an ISO time; minus infinity where it is none."""
    try:
        return datetime.fromisoformat(time).timestamp()
    except ValueError:
        return float("-inf")

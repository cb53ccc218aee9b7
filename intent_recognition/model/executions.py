# SPDX-License-Identifier: Apache-2.0
"""Outcomes of the executions of tasks, and each task's performance over time.

Executions are kept in the task folder beside the recordings:

    my_tasks/
      outcomes.jsonl                                 one line per new fact
      executions/give_cup/give_cup_0000, ...         the newest recordings of each task

Each line is appended once and synchronised to disk before anything else happens. An incomplete last
line counts as never written. Later lines extend or change what is known of the same recording.
"""

import json
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
"""Largest number of values of an execution, and of characters of each."""


@dataclass(frozen=True)
class Execution:
    """What is known of one execution, which ended at `time` (ISO 8601)."""

    time: str
    task: str
    bag: str  # recording, relative to the folder; an old one may have been removed
    # model with which the task was executed, relative to the folder; empty if the folder had none
    model: str
    # values by name: `outcome`, `corrections`, `thumbs` (`up`, `down`), `spilled` and others
    values: Mapping[str, str]

    @property
    def corrected(self) -> bool:
        """Whether a person corrected the arm's motion."""
        return self.number(CORRECTIONS) > 0.0

    def number(self, name: str) -> float:
        """A value as a number; 0 if it is missing or not a number."""
        try:
            return float(self.values.get(name, 0.0))
        except ValueError:
            return 0.0


class Executions:
    """Executions in a task folder."""

    def __init__(self, path: Path, clock: Callable[[], datetime]):
        self.path, self._clock = path, clock
        self._known: dict[str, Execution] = {}
        self._read_to = 0

    def all(self) -> list[Execution]:
        """Every known execution, oldest first.

        Reads only the lines added since the last call.
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
        """Complete lines added since the last call; all lines if the file has become shorter."""
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
        """Path for the recording of the next execution of a task.

        Raises:
            BagError: the label names no task.
        """
        check_label(task)
        names = [p.name for p in (self.path / EXECUTIONS / task).glob("*")]
        names += [Path(one.bag).name for one in self.all() if one.task == task]
        number = max((_number(Path(name)) for name in names), default=-1) + 1
        return self.path / EXECUTIONS / task / f"{task}_{number:04d}"

    def add(self, bag: Path, values: Mapping[str, str], model: str = "") -> None:
        """Store values of an execution, unless they are known already.

        Raises:
            ResourceBusyError: the file cannot be written.
        """
        kept = {str(k)[:LONGEST_VALUE]: str(v)[:LONGEST_VALUE] for k, v in values.items()}
        kept = dict(list(kept.items())[:MOST_VALUES])
        now = self._clock().isoformat(timespec="milliseconds")
        name = bag.relative_to(self.path).as_posix()
        if any(one.bag == name and kept.items() <= one.values.items() for one in self.all()):
            return
        line = Execution(now, bag.parent.name, name, model, kept)
        file = self.path / OUTCOMES
        is_torn = file.exists() and file.stat().st_size > self._read_to  # after `all`
        with writing(str(file)):
            append_line(file, "\n" * is_torn + json.dumps(asdict(line)))

    def thin(self, task: str, most: int) -> None:
        """Remove the oldest recordings of a task; their outcomes are kept."""
        found = sorted((self.path / EXECUTIONS / task).glob("*_[0-9]*"), key=_number)
        for bag in found[: max(len(found) - most, 0)]:
            shutil.rmtree(bag, ignore_errors=True)


def _number(bag: Path) -> int:
    """Number at the end of a recording's name; -1 without one."""
    end = bag.name.rpartition("_")[2]
    return int(end) if end.isdecimal() else -1


def _execution(line: str) -> Execution | None:
    """Execution stored in a line; None if the line is invalid."""
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
"""Keys on `teach/skills` that mark the change which an undo takes back, and a task with a
correction that can be kept."""
WAITING = "recordings that wait"
"""Key in the diagnostics of `task_teacher`: number of recordings not yet learned."""


class SkillPeriod(NamedTuple):
    """Performance of a task between two of its changes."""

    task: str
    since: str  # start, ISO 8601; empty: at the first execution
    what: str  # change in words
    model: str  # model since then, relative to the folder
    n_demonstrations: int
    n_executions: int = 0
    n_arrived: int = 0
    n_corrected: int = 0  # executions corrected by hand; n_up and n_down: rated good and bad
    n_up: int = 0
    n_down: int = 0
    spilled: float | None = None  # mean over executions with this value; None without any

    def texts(self) -> tuple[str, ...]:
        """Values of the columns `SKILL_COLUMNS`, as text."""
        n = self.n_executions
        counts = (self.n_arrived, self.n_corrected, self.n_up, self.n_down)
        shown = [f"{one}" for one in counts] if n else ["-"] * len(counts)
        return (str(n), *shown, "-" if self.spilled is None else f"{self.spilled:.2g}")


def skill_history(
    changes: Sequence[Change], executions: Sequence[Execution]
) -> dict[str, list[SkillPeriod]]:
    """Periods of each task, oldest first, from chronological changes and executions in any order.

    An execution belongs to the last change of its task before it. Undoing a change starts a period,
    too.
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
    """Periods of a task with statistics of its executions."""
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
    """Seconds of an ISO time; minus infinity if it is invalid."""
    try:
        return datetime.fromisoformat(time).timestamp()
    except ValueError:
        return float("-inf")

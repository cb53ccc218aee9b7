# SPDX-License-Identifier: Apache-2.0
"""What became of each execution of a task, kept in the folder of tasks beside its recording.

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
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import datetime
from pathlib import Path

from intent_recognition.demonstrations import check_label
from intent_recognition.durable import append_line, writing
from intent_recognition.model.history import are_texts, is_inside
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

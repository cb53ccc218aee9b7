# SPDX-License-Identifier: Apache-2.0
"""How each task has done over time: its changes, and what became of its executions since each."""

from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from intent_recognition.model.executions import (
    ARRIVED,
    DOWN,
    OUTCOME,
    SPILLED,
    THUMBS,
    UP,
    Execution,
)
from intent_recognition.model.history import IMPROVE, LEARN, START, UNDO, WAIT, Change

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

# SPDX-License-Identifier: Apache-2.0
"""Reaches whose goal moves to another task's on the way: how often, and how soon, it is noticed."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from typing import NamedTuple

import numpy as np

from experiments.change_of_mind.changes import change_of_mind
from experiments.change_of_mind.following import FollowedReach, follow_reach
from experiments.change_of_mind.without_pause import FlowingSession, follow_sessions
from experiments.settings import Settings
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import learn
from intent_recognition.promp import TaskLibrary
from sim_bridge.coworker import TASKS, USUAL_BLEND, Reach, WristMovement, draw_reach, draw_rest

SHARES = (0.15, 0.25, 0.4, 0.6)
"""Shares of the movement at which the mind changes."""
BLENDS = (0.15, 0.25, 0.4, None)
"""Shares of the movement that a change takes; None: replanned from the hand's state."""
AGAIN_AFTER = 0.3
"""Share of the movement between two changes of mind."""
PER_PAIR, UNCHANGED = 20, 100
"""Reaches for each ordered pair of tasks and each change to a task; reaches that do not change.

Half as many for each of the other changes.
"""
QUICK_PER_PAIR, QUICK_UNCHANGED = 1, 3
PAIRS = tuple(permutations(TASKS, 2))
"""Ordered pairs of tasks; the quick subset has the first."""
SESSIONS, INTERACTIONS = 20, 10
"""Sessions without pauses, and consecutive tasks in each."""
QUICK_SESSIONS, QUICK_INTERACTIONS = 1, 3
RELEASED_WITHIN_S = 0.5
"""Longest time from the change to the release of the old task that is in time [s]."""
_STREAM = 31
"""Separates these reaches from other draws of the same seed."""


class GoalChange(NamedTuple):
    """What is changed, and how.

    Attributes:
        share: of the movement at which the mind changes.
        blend: see `BLENDS`.
        to: "task" for another task's goal, "unknown" for that of none, "other" and "back" for a
            second change `AGAIN_AFTER` later, to the third task or back to the first.
    """

    share: float
    blend: float | None
    to: str = "task"


CHANGES = (
    *(GoalChange(share, blend) for blend in BLENDS for share in SHARES),
    *(GoalChange(share, blend, "unknown") for blend in (USUAL_BLEND, None) for share in SHARES),
    *(GoalChange(SHARES[0], USUAL_BLEND, to) for to in ("other", "back")),
)


class Cell(NamedTuple):
    """Statistics of reaches changed in the same way.

    Attributes:
        n: how many.
        new_active: share in which the new task was active at the end.
        old_kept: share in which an earlier task was.
        released_in_time: share with the old task released within `RELEASED_WITHIN_S`, of those in
            which it was active after the change; NaN without any.
        delay_s: median time from the change to the new task's activity; NaN if it never was.
        others: share in which a task that was never intended was active.
        hand_error_m: median, of those with the new task active; NaN without any.
    """

    n: int
    new_active: float
    old_kept: float
    released_in_time: float
    delay_s: float
    others: float
    hand_error_m: float


@dataclass(frozen=True)
class ChangeStudy:
    """Results of the study.

    Attributes:
        unchanged: reaches that do not change.
        changed: reaches of each kind of change.
        sessions: sessions without pauses.
    """

    unchanged: tuple[FollowedReach, ...]
    changed: dict[GoalChange, tuple[FollowedReach, ...]]
    sessions: tuple[FlowingSession, ...] = ()

    def cell(self, *changes: GoalChange) -> Cell:
        """All reaches of one change, or of several together."""
        return summarise([one for change in changes for one in self.changed[change]])


def investigate(settings: Settings) -> ChangeStudy:
    """Learn from the shipped demonstrations, and follow every reach."""
    settings.progress(0.0, "learning")
    library = learn_toolbox(settings)
    per_pair = QUICK_PER_PAIR if settings.quick else PER_PAIR
    unchanged = QUICK_UNCHANGED if settings.quick else UNCHANGED
    study = follow_all(
        library,
        settings.seed,
        per_pair,
        unchanged,
        settings.part(0.05, 0.85).progress,
        pairs=PAIRS[:1] if settings.quick else PAIRS,
    )
    sessions = follow_sessions(
        library,
        settings.seed,
        *((QUICK_SESSIONS, QUICK_INTERACTIONS) if settings.quick else (SESSIONS, INTERACTIONS)),
        settings.part(0.85, 0.95).progress,
    )
    return replace(study, sessions=tuple(sessions))


def learn_toolbox(settings: Settings) -> TaskLibrary:
    """The tasks of the shipped demonstrations."""
    bags = [settings.recordings("toolbox/train")]
    return learn(read_demonstrations(bags, load_dofs())[0])


def follow_all(
    library: TaskLibrary,
    seed: int,
    per_pair: int,
    unchanged: int,
    progress: Callable[[float, str], None] = lambda share, what: None,
    changes: Sequence[GoalChange] = CHANGES,
    pairs: Sequence[tuple[str, str]] = PAIRS,
) -> ChangeStudy:
    """Follow reaches of every change, and some that do not change.

    The same seed gives the same first reach and the same second goal whatever the share.

    Args:
        library: of the toolbox.
        seed: of all variation.
        per_pair: reaches for each ordered pair of tasks and each change to a task; half as many,
            but one at least, for each other change.
        unchanged: reaches that do not change.
        progress: called with the share done and what is going on.
        changes: kinds of change.
        pairs: first and second task.
    """
    counts = {c: per_pair if c.to == "task" else (per_pair + 1) // 2 for c in changes}
    total = unchanged + len(pairs) * sum(counts.values())
    done = 0

    def follow(movement: WristMovement, rng: np.random.Generator, what: str) -> FollowedReach:
        nonlocal done
        done += 1
        progress(done / total, what)
        return follow_reach(library, movement, rng)

    kept = []
    for k in range(unchanged):
        rng = np.random.default_rng([seed, _STREAM, 0, k])
        kept.append(follow(draw_reach(rng, TASKS[k % 3], draw_rest(rng)), rng, "unchanged"))
    changed = {
        change: tuple(
            follow(*drawn, f"changed at {change.share:.0%}")
            for pair, tasks in enumerate(pairs)
            for drawn in _draw(seed, pair, tasks, change, counts[change])
        )
        for change in changes
    }
    return ChangeStudy(tuple(kept), changed)


def _draw(
    seed: int, pair: int, tasks: tuple[str, str], change: GoalChange, count: int
) -> Iterator[tuple[WristMovement, np.random.Generator]]:
    """Reaches of one ordered pair of tasks, each with the generator of its noise."""
    for k in range(count):
        rng = np.random.default_rng([seed, _STREAM, 1 + pair, k])
        yield changed_reach(rng, draw_reach(rng, tasks[0], draw_rest(rng)), tasks[1], change), rng


def changed_reach(
    rng: np.random.Generator, first: Reach, task: str, change: GoalChange
) -> WristMovement:
    """Change a reach to another task's, or as `change` says."""
    if change.to == "unknown":
        return change_of_mind(rng, first, "", change.share, change.blend)
    changed = change_of_mind(rng, first, task, change.share, change.blend)
    if change.to == "task":
        return changed
    third = next(other for other in TASKS if other not in (first.task, task))
    then = {"other": third, "back": first.task}[change.to]
    return change_of_mind(rng, changed, then, change.share + AGAIN_AFTER, change.blend)


def summarise(followed: Sequence[FollowedReach]) -> Cell:
    """All reaches of one kind; see `Cell`."""
    release = np.array([one.release_s for one in followed])
    held = release[release > 0.0]  # a comparison with NaN is False
    right = [one for one in followed if one.new_active]
    errors = [one.hand_error_m for one in right if np.isfinite(one.hand_error_m)]
    return Cell(
        len(followed),
        float(np.mean([one.new_active for one in followed])),
        float(np.mean([one.old_kept for one in followed])),
        float(np.mean(held <= RELEASED_WITHIN_S)) if held.size else np.nan,
        float(np.median([one.delay_s for one in right])) if right else np.nan,
        float(np.mean([bool(one.others) for one in followed])),
        float(np.median(errors)) if errors else np.nan,
    )

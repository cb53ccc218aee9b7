# SPDX-License-Identifier: Apache-2.0
"""A rehearsal before deployment: what a model would have done during recordings it does not know.

Misses and wrong actions, with an interval for the share of these; the worst moments; how long
decisions and computations take; and what to demonstrate next.
"""

from collections.abc import Iterable
from time import perf_counter
from typing import NamedTuple

import numpy as np
from scipy.special import betaincinv

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation.online import actions, follow_online
from intent_recognition.evaluation.replaying import Decided
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import DecisionSettings, decision_settings
from intent_recognition.signals import Demonstration


class Rehearsed(NamedTuple):
    """What a model would have done during one recording."""

    recorded: Demonstration
    activated: tuple[str, ...]  # all tasks that became active, in order
    decided_s: float  # when the true one did, after the movement's start; NaN if it never did
    labels: tuple[str, ...]  # of the K tasks, and none
    times_s: Floats  # of the n estimates of the movement, after its start, (n,)
    probabilities: Floats  # theirs, (n, K + 1)
    active: tuple[str, ...]  # what was active then, empty for nothing, n texts
    odds_against: Floats  # log odds of all else against the true task, (n,)
    computed_s: Floats  # what each observation took to compute, (m,)

    @property
    def task(self) -> str:
        """The true one."""
        return str(self.recorded.task)

    @property
    def missed(self) -> bool:
        """Whether the true task never became active."""
        return self.task not in self.activated

    @property
    def wrong(self) -> bool:
        """Whether another task became active at any time."""
        return bool({*self.activated} - {self.task})

    @property
    def worst(self) -> int:
        """The moment in the second half of the movement at which the odds are the worst."""
        half = len(self.odds_against) // 2
        return half + int(np.argmax(self.odds_against[half:]))


class Rehearsal(NamedTuple):
    """What a model would have done during some recordings."""

    runs: tuple[Rehearsed, ...]

    @property
    def n_missed(self) -> int:
        """In how many the true task never became active."""
        return sum(run.missed for run in self.runs)

    @property
    def n_wrong(self) -> int:
        """In how many another task became active."""
        return sum(run.wrong for run in self.runs)

    def wrong_interval(self) -> tuple[float, float]:
        """Of the share acted on wrongly, by Clopper and Pearson, recordings being independent."""
        wrong, right = self.n_wrong, len(self.runs) - self.n_wrong
        low = betaincinv(wrong, right + 1, 0.025) if wrong else 0.0
        high = betaincinv(wrong + 1, right, 0.975) if right else 1.0
        return float(low), float(high)

    def worst(self, most: int) -> list[Rehearsed]:
        """The runs with the worst moments: wrong ones, then misses, then by the odds."""
        order = sorted(
            (run for run in self.runs if len(run.times_s)),
            key=lambda run: (run.wrong, run.missed, run.odds_against[run.worst]),
            reverse=True,
        )
        return order[:most]


def rehearse(
    library: TaskLibrary,
    recordings: Iterable[Demonstration],
    settings: DecisionSettings | None = None,
) -> Rehearsal:
    """Follow recordings, whose starts and ends are those of the movements, as the nodes do.

    The settings of the decision are the node's defaults when None.

    Raises:
        ArgumentError: no recording, or one of a task that the library does not know.
    """
    settings, runs = settings or decision_settings(library), []
    for recorded in recordings:
        if recorded.task not in library.labels:
            known, cure = f"one of {', '.join(library.labels)}", "Teach it, or leave it out."
            raise ArgumentError.about(f"task of {recorded.name}", known, recorded.task, cure)
        runs.append(_follow(library, recorded, settings))
    if not runs:
        raise ArgumentError.about("recordings", "labelled ones", "none", "Record some.")
    return Rehearsal(tuple(runs))


def _follow(library: TaskLibrary, recorded: Demonstration, settings: DecisionSettings) -> Rehearsed:
    true = library.labels.index(str(recorded.task))
    followed, computed_s = list[Decided](), list[float]()
    began_s = perf_counter()
    for one in follow_online(library, recorded, settings):
        computed_s.append(perf_counter() - began_s)
        followed.append(one)
        began_s = perf_counter()
    moving = [(one.estimate, one.state.active) for one in followed if one.estimate.moving]
    p = np.array([one.probabilities for one, _ in moving]).reshape(-1, library.n_tasks + 1)
    return Rehearsed(
        recorded,
        *actions(recorded, followed),
        (*library.labels, NONE),
        np.array([(one.stamp_ns - recorded.start_ns) * 1e-9 for one, _ in moving]),
        p,
        tuple(active for _, active in moving),
        np.log((1.0 - p[:, true] + 1e-12) / (p[:, true] + 1e-12)),  # odds of 0 and 1, too
        np.array(computed_s),
    )

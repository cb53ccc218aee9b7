# SPDX-License-Identifier: Apache-2.0
"""Rehearsal before deployment: what a model would have done during recordings new to it.

It counts misses and wrong actions, with a confidence interval of the latter's share; finds the
worst moments; times decisions and computations; and suggests what to demonstrate next.
"""

from collections.abc import Iterable, Sequence
from time import perf_counter
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import betaincinv

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.evaluation.online import actions, follow_online
from intent_recognition.evaluation.replaying import Decided
from intent_recognition.learning import Trained, TrainingExample, example_of
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import DecisionSettings, decision_settings
from intent_recognition.signals import Demonstration


class Rehearsed(NamedTuple):
    """Simulated run of a model during one recording."""

    recorded: Demonstration
    activated: tuple[str, ...]  # all tasks that became active, in order
    decided_s: float  # activation of the true task since the movement's start; NaN: never
    labels: tuple[str, ...]  # the K tasks, and none
    times_s: Floats  # times of the n estimates since the movement's start, (n,)
    probabilities: Floats  # posteriors at these times, (n, K + 1)
    active: tuple[str, ...]  # active task at these times, empty for none, n texts
    odds_against: Floats  # log odds of all else against the true task, (n,)
    computed_s: Floats  # computation time of each observation [s], (m,)

    @property
    def task(self) -> str:
        """The true task."""
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
        """Index of the highest odds against the task in the movement's second half."""
        half = len(self.odds_against) // 2
        return half + int(np.argmax(self.odds_against[half:]))


class Rehearsal(NamedTuple):
    """Simulated runs of a model during several recordings."""

    runs: tuple[Rehearsed, ...]

    @property
    def n_missed(self) -> int:
        """Number of runs in which the true task never became active."""
        return sum(run.missed for run in self.runs)

    @property
    def n_wrong(self) -> int:
        """Number of runs in which another task became active."""
        return sum(run.wrong for run in self.runs)

    def wrong_interval(self) -> tuple[float, float]:
        """Clopper-Pearson interval of the share acted on wrongly, for independent recordings."""
        wrong, right = self.n_wrong, len(self.runs) - self.n_wrong
        low = betaincinv(wrong, right + 1, 0.025) if wrong else 0.0
        high = betaincinv(wrong + 1, right, 0.975) if right else 1.0
        return float(low), float(high)

    def worst(self, most: int) -> list[Rehearsed]:
        """The `most` worst runs: wrong ones, then misses, then by odds against the true task."""
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
    """Follow recordings, whose start and end are those of the movement, as the nodes do.

    `settings` of the decision are the node's defaults when None.

    Raises:
        ArgumentError: no recording, or a recording of a task that the library does not know.
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


class Suggestion(NamedTuple):
    """A demonstration that is expected to reduce the risk most."""

    task: str
    like: int  # number of the rehearsed movement to repeat
    prevented: float  # expected decrease in the number of rehearsed movements that fail


def suggest_next(trained: Trained, rehearsal: Rehearsal, n: int) -> list[Suggestion]:
    """Suggest what to demonstrate next for the rehearsed tasks; see `suggest`.

    Raises:
        TrainingError: a recording is too short to compare.
    """
    shown = [example for task in trained.tasks.values() for example in task.examples]
    rehearsed = [example_of(run.recorded, trained.preprocessing) for run in rehearsal.runs]
    return suggest(shown, rehearsed, [run.missed or run.wrong for run in rehearsal.runs], n)


def suggest(
    shown: Sequence[TrainingExample],
    rehearsed: Sequence[TrainingExample],
    failed: Sequence[bool],
    n: int,
) -> list[Suggestion]:
    """Suggest which movements to demonstrate next, one after another.

    The uncertainty about a movement falls with the number of similar demonstrations: the mean of m
    samples of a Gaussian of known covariance has this covariance over m (the 1 / m in
    `TaskLibrary.weight_covariance`). The risk of a movement is assumed to fall in the same way. A
    demonstration with similarity k lowers its risk r to r m / (m + k). Here k = exp(-d^2 / 2), with
    the distance d of the observed paths in standard deviations of the tasks' demonstrations, and m
    is one plus the sum of the similarities of the task's demonstrations. The initial risk of a
    rehearsed movement is 1 if it failed and else 0, shrunk half-way to the failed share of its task
    (rule of succession). Each suggestion is the rehearsed movement whose demonstration lowers the
    sum of the risks most.

    Args:
        shown: the demonstrations that were learned from, two or more.
        rehearsed: movements that represent those expected of people, one or more.
        failed: whether each rehearsed movement was missed or acted on wrongly.
        n: number of suggestions.
    """
    tasks = np.array([one.task for one in (*shown, *rehearsed)])
    known, new = len(shown), slice(len(shown), None)
    likeness = np.exp(-0.5 * _squared_distances(shown, rehearsed)) * (tasks[new, None] == tasks)
    like = likeness[:, new]
    count = 1.0 + likeness[:, :known].sum(axis=1)
    risk, own = np.array(failed, dtype=np.float64), tasks[new]
    for task in set(own.tolist()):
        some = own == task
        rate = (risk[some].sum() + 1.0) / (some.sum() + 2.0)
        risk[some] = 0.5 * (risk[some] + rate)
    found = []
    for _ in range(n):
        prevented = (risk * like / (count + like)).sum(axis=1)
        best = int(np.argmax(prevented))
        found.append(Suggestion(str(own[best]), best, float(prevented[best])))
        risk = risk * count / (count + like[best])
        count = count + like[best]
    return found


def _squared_distances(
    shown: Sequence[TrainingExample], rehearsed: Sequence[TrainingExample]
) -> Floats:
    """Mean squared distances of rehearsed paths from all, in within-task variances, (J, D + J)."""
    paths = np.array([one.observed for one in (*shown, *rehearsed)])
    known, own = paths[: len(shown)], [one.task for one in shown]
    about = [known[[task == one for one in own]].mean(axis=0) for task in own]
    freedom = max(len(own) - len(set(own)), 1)
    variance = ((known - np.array(about)) ** 2).mean(axis=1).sum(axis=0) / freedom
    scaled = paths / np.sqrt(np.maximum(variance, 1e-12))
    flat = scaled.reshape(len(paths), -1)
    return np.asarray(cdist(flat[len(shown) :], flat, "sqeuclidean") / flat.shape[1])


def rehearsal_to_json(rehearsal: Rehearsal, suggestions: Sequence[Suggestion]) -> dict[str, object]:
    """A rehearsal and the suggested demonstrations as plain values."""
    return {
        "n": len(rehearsal.runs),
        "wrong": rehearsal.n_wrong,
        "wrong_interval": list(rehearsal.wrong_interval()),
        "missed": rehearsal.n_missed,
        "runs": [
            {
                "recording": run.recorded.name,
                "task": run.task,
                "activated": list(run.activated),
                "decided_s": None if run.missed else run.decided_s,
                "computed_ms": (1e3 * run.computed_s).tolist(),
            }
            for run in rehearsal.runs
        ],
        "suggestions": [
            one._asdict() | {"like": rehearsal.runs[one.like].recorded.name} for one in suggestions
        ],
    }

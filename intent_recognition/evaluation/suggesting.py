# SPDX-License-Identifier: Apache-2.0
"""What to demonstrate next, after a rehearsal: which task, and like which movement."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from intent_recognition.array_types import Floats
from intent_recognition.evaluation.rehearsing import Rehearsal
from intent_recognition.learning import Trained, TrainingExample, example_of


class Suggestion(NamedTuple):
    """A demonstration that is worth more than others."""

    task: str
    like: int  # number of the rehearsed movement that it should be like
    prevented: float  # of the rehearsed interactions, how many fewer are expected to go wrong


def suggest_next(trained: Trained, rehearsal: Rehearsal, n: int) -> list[Suggestion]:
    """What to demonstrate next to the tasks that were rehearsed; see `suggest`.

    Raises:
        TrainingError: a recording is too short to be compared with.
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
    """What to demonstrate next, one after the other.

    What demonstrations leave unknown of a movement is known worse the fewer of them were like it:
    of a Gaussian of known covariance, the variance of the mean of m is the covariance over m (the
    1 / m in `TaskLibrary.weight_covariance`). The risk of a movement is taken to fall likewise: a
    demonstration that is like it by a share k lowers the risk r to r m / (m + k), where m is one
    plus the shares of the task's demonstrations, each exp(-d^2 / 2); d is the distance of the
    observed paths in standard deviations of the tasks' demonstrations. The risk of a rehearsed
    movement is whether it failed, shrunk half-way to the share that failed of its task (rule of
    succession). Each suggestion is the rehearsed movement
    that a demonstration should be like to lower the sum of the risks most.

    Args:
        shown: the demonstrations that were learned from, two or more.
        rehearsed: movements with what is expected of people, one or more.
        failed: whether each of them was missed or acted on wrongly.
        n: how many suggestions.
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
    """Of the rehearsed paths from all, in variances of each DOF about its task, (J, D + J)."""
    paths = np.array([one.observed for one in (*shown, *rehearsed)])
    known, own = paths[: len(shown)], [one.task for one in shown]
    about = [known[[task == one for one in own]].mean(axis=0) for task in own]
    freedom = max(len(own) - len(set(own)), 1)
    variance = ((known - np.array(about)) ** 2).mean(axis=1).sum(axis=0) / freedom
    scaled = paths / np.sqrt(np.maximum(variance, 1e-12))
    flat = scaled.reshape(len(paths), -1)
    return np.asarray(cdist(flat[len(shown) :], flat, "sqeuclidean") / flat.shape[1])


def rehearsal_to_json(rehearsal: Rehearsal, suggestions: Sequence[Suggestion]) -> dict[str, object]:
    """A rehearsal and what to demonstrate next as plain values."""
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

# SPDX-License-Identifier: Apache-2.0
"""How hard the demonstrations are: a shortcut on the position against the whole history.

Both classifiers know the phase. The shortcut takes the nearest task mean of the wrist position at
a share of the movement. The other is a Gaussian per task with a common covariance over what was
seen up to there: where the wrist started and its displacement from there.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.teaching.demonstration import (
    TEST_COUNTS,
    TRAINING_COUNTS,
    WristDemonstration,
    demonstration_rng,
    plan_demonstration,
)
from intent_recognition.array_types import Floats, Integers
from sim_bridge.coworker import TASKS

Classifier = Callable[[Floats, Integers, Floats], Integers]
"""From training features (n, d), their labels (n,) and other features (m, d) to labels (m,)."""


@dataclass(frozen=True)
class Hardness:
    """Accuracies at one share of the movement, phase known.

    Attributes:
        share: share of the movement's time that was seen.
        position_leave_one_out: nearest task mean of the position, leave-one-out on training.
        position_test: the same, trained on all of training, on the test demonstrations.
        history_leave_one_out: Gaussian on start and displacement, leave-one-out on training.
        history_test: the same on the test demonstrations.
        separation_m: smallest distance between two tasks' mean displacement from the start.
    """

    share: float
    position_leave_one_out: float
    position_test: float
    history_leave_one_out: float
    history_test: float
    separation_m: float


def wrist_at(demonstration: WristDemonstration, shares: Sequence[float]) -> Floats:
    """Measured wrist positions (S, 3) at shares of the movement's time, interpolated over gaps."""
    samples = demonstration.samples
    span = demonstration.end_s - demonstration.onset_s
    times = demonstration.onset_s + span * np.asarray(shares)
    seen = samples.visible
    return np.column_stack(
        [np.interp(times, samples.times_s[seen], samples.positions_m[seen, k]) for k in range(3)]
    )


def nearest_mean_labels(train: Floats, labels: Integers, test: Floats) -> Integers:
    """Index of the nearest class mean, for each row of `test` (n, d)."""
    means = np.array([train[labels == label].mean(axis=0) for label in np.unique(labels)])
    distances = np.linalg.norm(test[:, None] - means, axis=2)
    return np.unique(labels)[np.argmin(distances, axis=1)]


def gaussian_labels(train: Floats, labels: Integers, test: Floats) -> Integers:
    """Index of the most probable class: Gaussians with a pooled, slightly shrunk covariance."""
    classes = np.unique(labels)
    means = np.array([train[labels == label].mean(axis=0) for label in classes])
    residuals = train - means[np.searchsorted(classes, labels)]
    covariance = residuals.T @ residuals / (len(train) - len(classes))
    covariance += 0.01 * np.diag(np.diag(covariance))
    difference = test[:, None] - means
    solved = np.linalg.solve(covariance, difference.reshape(-1, test.shape[1]).T).T
    distances = np.sum(difference * solved.reshape(difference.shape), axis=2)
    return classes[np.argmin(distances, axis=1)]


def _history(demonstrations: Sequence[WristDemonstration], share: float) -> Floats:
    """Start and displacements from it at thirds of the share, (n, 12)."""
    rows = []
    for demonstration in demonstrations:
        seen = wrist_at(demonstration, [0.0, share / 3, 2 * share / 3, share])
        rows.append(np.concatenate([seen[0], *(seen[1:] - seen[0])]))
    return np.array(rows)


def _leave_one_out(classify: Classifier, features: Floats, labels: Integers) -> float:
    """Accuracy."""
    hits = 0
    for k in range(len(labels)):
        rest = np.arange(len(labels)) != k
        hits += int(classify(features[rest], labels[rest], features[k : k + 1])[0] == labels[k])
    return hits / len(labels)


def measure_hardness(
    train: Sequence[WristDemonstration], test: Sequence[WristDemonstration], share: float = 0.3
) -> Hardness:
    """Score both classifiers on what has been seen at `share` of the movement."""
    labels = np.array([TASKS.index(d.reach.task) for d in train])
    truth = np.array([TASKS.index(d.reach.task) for d in test])
    position = np.array([wrist_at(d, [share])[0] for d in train])
    test_position = np.array([wrist_at(d, [share])[0] for d in test])
    history, test_history = _history(train, share), _history(test, share)
    moved = [history[labels == k, -3:].mean(axis=0) for k in range(len(TASKS))]
    gaps = [np.linalg.norm(moved[a] - moved[b]) for a in range(3) for b in range(a)]
    return Hardness(
        share,
        _leave_one_out(nearest_mean_labels, position, labels),
        float(np.mean(nearest_mean_labels(position, labels, test_position) == truth)),
        _leave_one_out(gaussian_labels, history, labels),
        float(np.mean(gaussian_labels(history, labels, test_history) == truth)),
        float(min(gaps)),
    )


def draw_set(seed: int, counts: Mapping[str, int], purpose: int) -> list[WristDemonstration]:
    """The wrist demonstrations of one set; `purpose` keeps training (0) and test (1) apart."""
    return [
        plan_demonstration(demonstration_rng(seed, purpose, task, index), task)
        for task, count in counts.items()
        for index in range(count)
    ]


def hardness_table(seed: int, shares: Sequence[float] = (0.1, 0.2, 0.3, 0.5)) -> str:
    """A Markdown table of both classifiers' accuracies for the sets of a seed."""
    train, test = draw_set(seed, TRAINING_COUNTS, 0), draw_set(seed, TEST_COUNTS, 1)
    rows = [
        "| of the movement | position: leave-one-out / test | history: leave-one-out / test "
        "| tasks apart |",
        "|---|---|---|---|",
    ]
    for share in shares:
        h = measure_hardness(train, test, share)
        rows.append(
            f"| {share:.0%} | {h.position_leave_one_out:.2f} / {h.position_test:.2f} "
            f"| {h.history_leave_one_out:.2f} / {h.history_test:.2f} "
            f"| {h.separation_m * 100:.1f} cm |"
        )
    return "\n".join(rows)

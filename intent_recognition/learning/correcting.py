# SPDX-License-Identifier: Apache-2.0
"""A correction that is kept: the robot's part of a task moves, the person's stays as it is.

A demonstration says how a task is done, and adds to the others. A correction says that the others
are wrong: the rule by which the robot follows from the person has moved. With w_c = A w_o + b + e,
the correction's residual r = w_c - A w_o - b tells b apart from what it was,

    b <- b + g r.

This is the Kalman filter of a rule that drifts, with its stationary gain g: for a drift between two
corrections of variance q, in parts of the variance of one correction, g^2 / (1 - g) = q. What is
recognised, how surely, and all other tasks are left alone to the last bit.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from intent_recognition.errors import TrainingError, describe
from intent_recognition.learning.examples import TrainingExample, scored_phases
from intent_recognition.learning.fitting import learned_from
from intent_recognition.learning.preprocessing import example_of
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.learning.training import Trained
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.signals import Demonstration

GAIN = 0.5
"""Share g of a correction that a task takes over. Convention: each halves the error, so that three
leave an eighth of it, and one that was a mistake moves the task half the way (q = 0.5)."""


def keep_correction(trained: Trained, corrected: Demonstration, gain: float = GAIN) -> Trained:
    """Move the robot's part of a known task towards a corrected execution.

    Args:
        trained: what to change; it stays as it is.
        corrected: what the person did, and how the robot was wanted to move, labelled.
        gain: share g of the difference that is taken over, in [0, 1].

    Raises:
        TrainingError: the task is not known, or the execution cannot be used; says why.
    """
    example = example_of(corrected, trained.preprocessing)
    return move_task(trained, example, gain)


def move_task(trained: Trained, example: TrainingExample, gain: float = GAIN) -> Trained:
    """As `keep_correction`, from an example of the same preprocessing."""
    library, label = trained.library, example.task
    if label not in library.labels:
        cure = "Teach it first."
        raise TrainingError(describe("task", f"one of {library.labels}", label, cure))
    aligned = trained.chosen.aligned
    chosen = example.aligned if aligned and example.aligned is not None else example
    n_observed = library.n_observed
    rule = library.regressions[library.labels.index(label)]
    observed, controlled = chosen.weights[:n_observed], chosen.weights[n_observed:]
    residual = controlled.ravel() - rule.matrix @ observed.ravel() - rule.offset
    change = gain * residual.reshape(controlled.shape)
    task = trained.tasks[label]
    moved = _moved(task, change, library.basis, trained.preprocessing.basis_of(False))
    if task.aligned is not None:
        other = _moved(task.aligned, change, library.basis, trained.preprocessing.basis_of(True))
        moved = replace(moved, aligned=other)
    tasks = {**trained.tasks, label: moved}
    means = learned_from(tasks, trained.preprocessing, trained.chosen)["weight_mean"]
    return replace(trained, library=replace(library, weight_mean=means), tasks=tasks)


def _moved(
    task: TaskStatistics,
    change: NDArray[np.float64],
    basis: NormalizedRBFBasis,
    own: NormalizedRBFBasis,
) -> TaskStatistics:
    """The statistics of demonstrations whose controlled weights are all changed alike.

    Args:
        task: of the demonstrations.
        change: (Q, N) in `basis`.
        basis: of the change.
        own: of the statistics.
    """
    if own != basis:
        phases = np.linspace(0.0, 1.0, 201)
        curve = basis.design_matrix(phases) @ change.T
        change = np.linalg.lstsq(own.design_matrix(phases), curve, rcond=None)[0].T
    offset = np.zeros_like(task.mean)
    offset[-len(change) :] = change
    scored = own.design_matrix(scored_phases()) @ change.T
    examples = tuple(
        one._replace(weights=one.weights + offset, controlled=one.controlled + scored)
        for one in task.examples
    )
    return replace(task, mean=task.mean + offset, examples=examples)

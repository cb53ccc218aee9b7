# SPDX-License-Identifier: Apache-2.0
"""Learn a correction: the robot's part of a task moves, the person's part stays the same.

A demonstration adds to the others. A correction says that the others are wrong: the rule, which is
the regression of the robot's weights on the person's, has changed,

    w_c = A w_o + b + W x + e,   x = (1, (w_o - m) / s),   s^2 = tr S_oo,

where m and S_oo are the mean and covariance of the observed weights (`place_scale` gives s where
they have several units). All controlled weights share x, so the covariance of W is that of e times
one matrix P, and there is one gain k. A correction with residual r = w_c - A w_o - b gives

    k = P x / (x^T P x + 1),   W = r k^T,   P <- P - k x^T P + Q,

which is recursive least squares for coefficients that drift (Ljung 1999, Section 11.2). W is then
absorbed into A and b. The first correction counts almost in full. Each later one counts less than
the one before, so that errors of single corrections average out, but never less than the drift Q
requires.

The filter infers w_o from the person's movement, as it did when the robot's path was predicted.
Recognition and all other tasks stay the same to the last bit.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError
from intent_recognition.gaussian import Gaussian, symmetrize
from intent_recognition.learning.examples import (
    SAMPLES_PER_MOVEMENT,
    SAMPLES_USED,
    TrainingExample,
    pose_phases,
    sample_phases,
)
from intent_recognition.learning.preprocessing import example_of
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.learning.training import Trained
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis, TaskLibrary, steady_phase
from intent_recognition.signals import Demonstration, commensurate

OFFSET_VARIANCE = 20.0
"""Prior variance of the rule's offset, relative to the variance of one correction: people correct
errors that are several times the spread of their corrections."""
SLOPE_VARIANCE, DRIFT = 1.0, 0.5
"""Prior variance of the rule's dependence on where the person reaches, and variance by which the
offset drifts between corrections, both relative to one correction's (docs/correcting.md)."""


class RuleChange(NamedTuple):
    """The controlled weights change by `slopes` (w_o - m) + `offset`."""

    slopes: Floats  # (Q N, P N)
    offset: Floats  # (Q N,)


def keep_correction(
    trained: Trained, corrected: Demonstration, earlier: Sequence[Demonstration] = ()
) -> Trained:
    """Move the robot's part of a known task towards a corrected execution, in a copy.

    `corrected` is labelled and holds the person's movement and the robot's desired movement.
    `earlier` are the previous corrections of the same task, oldest first.

    Raises:
        TrainingError: the task is not known, or an execution cannot be used (the message says why).
    """
    examples = [example_of(one, trained.preprocessing) for one in (*earlier, corrected)]
    return move_task(trained, examples[-1], examples[:-1])


def move_task(
    trained: Trained, example: TrainingExample, earlier: Sequence[TrainingExample] = ()
) -> Trained:
    """Do what `keep_correction` does, from examples of the same preprocessing.

    Raises:
        TrainingError: the task is not known.
    """
    library, label = trained.library, example.task
    if label not in library.labels:
        cure = "Teach it first."
        known = f"one of {', '.join(library.labels)}"
        raise TrainingError.about("task", known, label, cure)
    task, n = library.labels.index(label), library.n_observed_weights
    seen = [inferred_weights(trained, one) for one in (*earlier, example)]
    mean, scale = library.weight_mean[task], place_scale(library, task)
    gain = correction_gain([(one - mean[:n]) / scale for one in seen])
    rule = library.regressions[task]
    controlled = _chosen(trained, example).weights[library.n_observed :].ravel()
    residual = controlled - rule.matrix @ seen[-1] - rule.offset
    change = RuleChange(np.outer(residual, gain[1:] / scale), gain[0] * residual)
    return change_rule(trained, label, change)


def place_scale(library: TaskLibrary, task: int) -> Floats:
    """Scale s that divides each observed weight's distance from its mean, (P N,).

    DOFs with commensurate units (`signals.commensurate`) share one scale; each kind of unit counts
    in proportion to its DOFs. If all units are commensurate, s^2 = tr S_oo.
    """
    n, scale = library.n_observed, np.empty(library.n_observed_weights)
    variance = np.diagonal(library.weight_covariance[task])[: len(scale)].reshape(n, -1)
    for dofs in commensurate(library.observed_units):
        scale.reshape(n, -1)[dofs] = np.sqrt(variance[dofs].sum() * n / len(dofs))
    return scale


def change_rule(trained: Trained, label: str, change: RuleChange) -> Trained:
    """Change the rule of a known task, in a copy."""
    library, task = trained.library, trained.library.labels.index(label)
    statistics, bases = trained.tasks[label], trained.preprocessing.basis_of
    moved = _moved(statistics, change, library, bases(False))
    if statistics.aligned is not None:
        aligned = _moved(statistics.aligned, change, library, bases(True))
        moved = replace(moved, aligned=aligned)
    return replace(
        trained, library=_with_rule(library, task, change), tasks={**trained.tasks, label: moved}
    )


def correction_gain(places: Sequence[Floats]) -> Floats:
    """Gain k of the last correction of a task, (1 + M,), the offset's first.

    `places` holds (w_o - m) / s of each correction, (M,), oldest first.
    """
    covariance = np.diag(np.r_[OFFSET_VARIANCE, np.full(len(places[-1]), SLOPE_VARIANCE)])
    gain = np.empty(0)
    for k, place in enumerate(places):
        if k:
            covariance[0, 0] += DRIFT
        x = np.r_[1.0, place]
        along = covariance @ x
        gain = along / (x @ along + 1.0)
        covariance -= np.outer(gain, along)
    return gain


def _chosen(trained: Trained, example: TrainingExample) -> TrainingExample:
    """The aligned example if the library's primitives are aligned, else the example itself."""
    aligned = example.aligned if trained.chosen.aligned else None
    return example if aligned is None else aligned


def inferred_weights(trained: Trained, example: TrainingExample) -> Floats:
    """Observed weights that the filter infers from the person's whole movement, (P N,)."""
    library, n_observed = trained.library, trained.library.n_observed
    task = library.labels.index(example.task)
    interval_s = library.correlation_time_s * SAMPLES_PER_MOVEMENT / SAMPLES_USED
    person = InteractionProMP(
        library.basis,
        Gaussian(library.observed_mean[task], library.observed_covariance[task]),
        n_observed,
        np.diag(library.noise_covariance(np.arange(n_observed), interval_s)),
        example.duration_s,
    )
    phases = sample_phases()
    if not trained.chosen.aligned or example.aligned is None:
        relative = example.duration_s / library.usual_s[task]
        phases = steady_phase(library.phase_deviation, phases, relative)
    seen, _ = person.condition(phases, _chosen(trained, example).observed)
    return seen.weights.mean


def _with_rule(library: TaskLibrary, task: int, change: RuleChange) -> TaskLibrary:
    """The library with A + slopes in one task, and the residual covariance unchanged.

    The task's regression on the present state, which knows uncorrected poses, has no share.
    """
    n = library.n_observed_weights
    means, covariances = library.weight_mean.copy(), library.weight_covariance.copy()
    means[task, n:] += change.offset
    covariances[task] = _sheared(covariances[task], change.slopes)
    context = library.context
    if context is not None:
        gain = context.gain.copy()
        gain[task, n:] += change.slopes @ gain[task, :n]
        context = replace(context, gain=gain)
    regression = library.pose_regression
    if regression is not None:
        share = regression.share.copy()
        share[task] = 0.0
        regression = regression._replace(share=share)
    return replace(
        library,
        weight_mean=means,
        weight_covariance=covariances,
        context=context,
        pose_regression=regression,
    )


def _sheared(matrix: Floats, slopes: Floats) -> Floats:
    """T M T^T with T = [[1, 0], [slopes, 1]]; the observed block is the same to the last bit."""
    n, out = slopes.shape[1], matrix.copy()
    out[n:, :n] += slopes @ matrix[:n, :n]
    out[:n, n:] = out[n:, :n].T
    out[n:, n:] = symmetrize(matrix[n:, n:] + slopes @ matrix[:n, n:] + out[n:, :n] @ slopes.T)
    return out


def _moved(
    task: TaskStatistics, change: RuleChange, library: TaskLibrary, own: NormalizedRBFBasis
) -> TaskStatistics:
    """Statistics over the basis `own` after a change that is given over the library's basis."""
    if own != library.basis:
        change = _onto(own, library.basis, change)
    slopes, n_basis = change.slopes, own.n_basis
    n, design = slopes.shape[1], own.design_matrix(pose_phases())
    centre = task.mean.ravel()[:n]

    def follow(weights: Floats) -> Floats:
        """The change of a demonstration's controlled weights, (Q, N)."""
        return (slopes @ (weights.ravel()[:n] - centre) + change.offset).reshape(-1, n_basis)

    def shift(example: TrainingExample) -> Floats:
        """The change of a demonstration's recorded controlled values, (s, Q)."""
        number = library.labels.index(example.task)
        scaling = replace(library, basis=own).in_durations(number, example.duration_s)
        return design @ scaling @ follow(example.weights).T

    def raised(weights: Floats) -> Floats:
        return np.vstack([weights[: n // n_basis], weights[n // n_basis :] + follow(weights)])

    cross = task.context_cross.copy()
    cross[n:] += slopes @ cross[:n]
    examples = tuple(
        one._replace(weights=raised(one.weights), controlled=one.controlled + shift(one))
        for one in task.examples
    )
    weights = np.array([one.weights for one in examples])
    return replace(
        task,
        mean=raised(task.mean),
        scatter=_sheared(task.scatter, slopes),
        lowest=weights.min(axis=(0, 2)),
        highest=weights.max(axis=(0, 2)),
        context_cross=cross,
        examples=examples,
    )


def _onto(target: NormalizedRBFBasis, source: NormalizedRBFBasis, change: RuleChange) -> RuleChange:
    """Express a change over the `source` basis in the `target` basis, by least squares."""
    phases = np.linspace(0.0, 1.0, 201)
    designs = [basis.design_matrix(phases) for basis in (target, source)]
    there, back = (np.linalg.lstsq(a, b, rcond=None)[0] for a, b in (designs, designs[::-1]))
    n_own, n_observed = (size // source.n_basis for size in change.slopes.shape)
    forth = np.kron(np.eye(n_own), there)
    return RuleChange(
        forth @ change.slopes @ np.kron(np.eye(n_observed), back), forth @ change.offset
    )

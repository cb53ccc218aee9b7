# SPDX-License-Identifier: Apache-2.0
"""Held-out validation of the aligned primitives, with the filter that runs online.

It decides whether trajectories are predicted from aligned primitives: where people keep a steady
pace, those at steady progress predict as well, and the end more precisely (docs/prediction.md).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import PhaseDeviationFilter
from intent_recognition.gaussian import symmetrize
from intent_recognition.learning.examples import TrainingExample, sample_phases, scored_phases
from intent_recognition.learning.selection import FRACTIONS, Hyperparameters
from intent_recognition.learning.statistics import (
    TaskStatistics,
    aligned_statistics,
    pooled_moments,
    variance_scales,
)
from intent_recognition.promp import (
    AlignedPrimitives,
    Scatter,
    leave_one_out_scatter,
    leave_one_out_targets,
    reference_phase,
    shrunk_covariance,
)

ALIGNED_STRENGTHS = (10.0, 30.0, 100.0)
"""Equivalent sample sizes of the aligned covariances' target that are tried, in demonstrations.
Convention."""
ALIGNED_NOISE_SCALES = (4.0, 16.0)
"""Factors of the observed DOFs' noise variance that are tried for aligned primitives. Convention.
"""
MAX_VALIDATED = 12
"""Demonstrations of one task that are held out at most, evenly drawn. Convention: it bounds the
time."""


class AlignedCandidate(NamedTuple):
    """Aligned primitives, and the equivalent sample size of their covariances' target."""

    primitives: AlignedPrimitives
    strength: float


def choose_aligned(
    steady: AlignedPrimitives,
    aligned: AlignedPrimitives,
    tasks: Mapping[str, TaskStatistics],
    chosen: Hyperparameters,
) -> Hyperparameters:
    """Hyperparameters of the aligned primitives, and whether predictions come from them.

    They do where held-out demonstrations are predicted with less error than at steady progress.

    Args:
        steady: primitives at steady progress.
        aligned: primitives over reference phase.
        tasks: statistics of each label.
        chosen: the other hyperparameters.
    """
    over_reference = aligned_statistics(tasks)
    if over_reference is None:
        return chosen
    floor, _ = variance_scales(tasks)
    (least,) = validate_held_out([AlignedCandidate(steady, chosen.strength)], tasks, tasks, floor)
    tried = [
        AlignedCandidate(replace(aligned, noise_scale=noise_scale), strength)
        for strength in ALIGNED_STRENGTHS
        for noise_scale in ALIGNED_NOISE_SCALES
    ]
    floor, _ = variance_scales(over_reference)
    errors = validate_held_out(tried, over_reference, tasks, floor)
    best = int(np.argmin(errors))
    if errors[best] < least:
        primitives, strength = tried[best]
        chosen = chosen._replace(
            aligned=True, aligned_strength=strength, aligned_noise_scale=primitives.noise_scale
        )
    return chosen


def validate_held_out(
    tried: Sequence[AlignedCandidate],
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
    floor: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Mean squared error of the controlled agent of held-out demonstrations, (c,).

    Each DOF counts in parts of its variance over all demonstrations; mean over DOFs, phases and
    shares of the movement observed (`selection.FRACTIONS`). The duration is known. Infinite if no
    demonstration can be left out.

    Args:
        tried: what is validated; means and covariances of the primitives are replaced by those
            without the demonstration held out.
        tasks: statistics that means and covariances are from.
        recorded: statistics of the examples as they were recorded, of the same tasks.
        floor: variance floor per DOF, (D,).
    """
    pooled = pooled_moments(tasks.values())
    truths = [e.controlled for task in recorded.values() for e in task.examples]
    scale = np.maximum(np.var(np.concatenate(truths), axis=0), 1e-12)
    errors: list[list[NDArray[np.float64]]] = [[] for _ in tried]
    for label, task in tasks.items():
        if task.n < 2:
            continue
        pairs = list(zip(task.examples, recorded[label].examples, strict=True))
        drawn = np.unique(np.linspace(0, len(pairs) - 1, MAX_VALIDATED).round().astype(int))
        left_out = _leave_out(task, pooled, [pairs[index] for index in drawn], floor)
        regressions = {}
        for index, (primitives, strength) in enumerate(tried):
            if strength not in regressions:
                size = primitives.n_observed_weights
                regressions[strength] = _regressions(size, left_out, strength)
            errors[index].append(_task_errors(primitives, regressions[strength], left_out) / scale)
    return np.array([np.concatenate(rows).mean() if rows else np.inf for rows in errors])


class _LeftOut(NamedTuple):
    """n demonstrations of one task, each with the statistics of the others.

    Attributes:
        n: of all demonstrations of the task.
        mean: of the weights, (n, D N).
        scatter, target: (n, D N, D N) each.
        samples: of the observed DOFs, (m, n, P).
        truth: of the controlled DOFs, (n, s, Q).
    """

    n: int
    mean: NDArray[np.float64]
    scatter: NDArray[np.float64]
    target: NDArray[np.float64]
    samples: NDArray[np.float64]
    truth: NDArray[np.float64]


def _leave_out(
    task: TaskStatistics,
    pooled: Scatter,
    pairs: Sequence[tuple[TrainingExample, TrainingExample]],
    floor: NDArray[np.float64],
) -> _LeftOut:
    """What does not depend on how it is predicted."""
    deviation = np.array([example.weights for example, _ in pairs]) - task.mean
    flat = deviation.reshape(len(pairs), -1)
    return _LeftOut(
        task.n,
        task.mean.ravel() - flat / (task.n - 1),
        leave_one_out_scatter(task.moments, flat),
        leave_one_out_targets(task.moments, pooled, deviation, floor),
        np.stack([recorded.observed for _, recorded in pairs], axis=1),
        np.array([recorded.controlled for _, recorded in pairs]),
    )


def _regressions(
    size: int, left_out: _LeftOut, strength: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariances of the observed weights (n, P N, P N) and gains on the rest (n, Q N, P N)."""
    covariance = shrunk_covariance(left_out.scatter, left_out.n - 1, left_out.target, strength)
    covariance = symmetrize(covariance)
    observed, cross = covariance[:, :size, :size], covariance[:, :size, size:]
    return observed, np.swapaxes(np.linalg.solve(observed, cross), 1, 2)


def _task_errors(
    primitives: AlignedPrimitives,
    regressions: tuple[NDArray[np.float64], NDArray[np.float64]],
    left_out: _LeftOut,
) -> NDArray[np.float64]:
    """Mean squared error of each DOF of each demonstration of one task, (n, Q)."""
    (covariance, gain), mean = regressions, left_out.mean
    n, size = len(mean), primitives.n_observed_weights
    run = PhaseDeviationFilter(primitives, mean[:, :size], covariance, np.ones(n))
    dofs = np.arange(primitives.n_observed)
    noise = np.diag(primitives.noise_variance[dofs] * primitives.noise_scale)
    errors, shares = [], list(FRACTIONS)
    for phase, values in zip(sample_phases(), left_out.samples, strict=True):
        if shares and phase > shares[0]:
            errors.append((_predicted(run, mean, gain) - left_out.truth) ** 2)
            shares.pop(0)
        run.observe(float(phase), dofs, values, noise)
    errors += [(_predicted(run, mean, gain) - left_out.truth) ** 2 for _ in shares]
    return np.mean(errors, axis=(0, 2))


def _predicted(
    run: PhaseDeviationFilter, mean: NDArray[np.float64], gain: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean of the controlled agent at the scored phases, (n, s, Q)."""
    primitives, size = run.primitives, run.primitives.n_observed_weights
    change = np.matmul(gain, (run.mean - mean[:, :size])[..., None])[..., 0]
    weights = (mean[:, size:] + change).reshape(len(mean), primitives.n_controlled, -1)
    deviation = run.deviations_at(scored_phases())
    recorded = np.tile(scored_phases(), (len(mean), 1))
    design = primitives.basis.design_matrix(reference_phase(primitives.phase_deviation, recorded))
    row = np.einsum("nse,nsek->nsk", deviation, design)
    return np.einsum("nsk,nqk->nsq", row, weights)

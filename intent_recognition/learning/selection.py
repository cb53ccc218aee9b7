# SPDX-License-Identifier: Apache-2.0
"""Choose the regularisation by leave-one-out prediction of the controlled agent.

For every demonstration left out of its own task, the controlled agent's trajectory is predicted
from evenly spaced samples of the observed one, after each of `FRACTIONS` of the movement. Of the
pairs (strength of the target, scale of the noise) the one of least error is taken. The target too
is estimated without the one left out.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import symmetrize
from intent_recognition.learning.examples import TrainingExample, sample_phases, scored_phases
from intent_recognition.learning.statistics import TaskStatistics, pooled_moments, variance_scales
from intent_recognition.promp import (
    NormalizedRBFBasis,
    Scatter,
    leave_one_out_scatter,
    leave_one_out_targets,
    shrunk_covariance,
)

STRENGTHS = (0.3, 1.0, 2.0, 4.0, 10.0, 30.0, 100.0, 300.0)
"""Equivalent sample sizes of the covariances' target that are tried, in demonstrations. Convention.
"""
NOISE_SCALES = (1.0, 4.0, 16.0, 64.0)
"""Factors of the observed DOFs' noise variance that are tried. Convention."""
FRACTIONS = (0.25, 0.5, 0.75, 1.0)
"""Shares of the movement after which the rest is predicted. Convention: those of `intent evaluate`.
"""
MAX_SCORED = 600
"""Demonstrations of all tasks that hyperparameters are chosen on, at most. Convention: it bounds
the time."""
SCORED_TOGETHER = 16
"""Demonstrations left out at a time. Convention: it bounds the memory of their covariances."""


class Hyperparameters(NamedTuple):
    """Hyperparameters and their leave-one-out score, lower wins.

    Attributes:
        strength: equivalent sample size of the covariances' target, in demonstrations.
        noise_scale: factor of the observed DOFs' noise variance.
        score: mean squared error of the controlled agent, each DOF in parts of its variance.
        aligned: whether trajectories are predicted from the aligned primitives.
        aligned_strength, aligned_noise_scale: the first two for the aligned primitives.
        recognition_strength, recognition_noise_scale: the first two for recognition.
    """

    strength: float
    noise_scale: float
    score: float
    aligned: bool = False
    aligned_strength: float = 30.0
    aligned_noise_scale: float = 4.0
    recognition_strength: float = 1.0
    recognition_noise_scale: float = 1.0


class TaskSamples(NamedTuple):
    """Evenly spaced samples of demonstrations of one task, for scoring.

    Attributes:
        mean: mean weights of all demonstrations of the task, (D, N), observed DOFs first.
        scatter: about that mean, of all demonstrations of the task.
        weights: of the n demonstrations to score, some or all of them, (n, D, N).
        observed: samples of the observed DOFs, (n, m, P).
        design: basis at the samples' phases, (n, m, N).
        phase: their phases, (n, m), increasing.
        controlled: truth of the controlled DOFs at the scored phases, (n, s, Q).
    """

    mean: NDArray[np.float64]
    scatter: Scatter
    weights: NDArray[np.float64]
    observed: NDArray[np.float64]
    design: NDArray[np.float64]
    phase: NDArray[np.float64]
    controlled: NDArray[np.float64]


def leave_one_out_scores(
    samples: TaskSamples,
    targets: NDArray[np.float64],
    noise_variance: NDArray[np.float64],
    scored_design: NDArray[np.float64],
    strength: float,
    noise_scales: Sequence[float] = NOISE_SCALES,
) -> NDArray[np.float64]:
    """Mean squared error of each demonstration's controlled samples, (len(noise_scales), n).

    Each DOF counts in parts of its variance along the task and between demonstrations.

    Args:
        samples: of a task of at least two demonstrations.
        targets: target covariance without each demonstration in turn, (n, D N, D N).
        noise_variance: residual variance per DOF, (D,).
        scored_design: basis at the scored phases, (s, N).
        strength: equivalent sample size of the target, in demonstrations.
        noise_scales: factors of the observed DOFs' noise variance to try.
    """
    n, n_dofs, n_basis = samples.weights.shape
    n_observed = samples.observed.shape[2]
    split = n_observed * n_basis
    rest = samples.scatter.freedom  # demonstrations of the task without the one left out
    deviation = (samples.weights - samples.mean).reshape(n, -1)
    mean = samples.mean.ravel() - deviation / rest
    scatter = leave_one_out_scatter(samples.scatter, deviation)
    covariance = shrunk_covariance(scatter, rest, targets, strength)
    s_oo, s_oc = covariance[:, :split, :split], covariance[:, :split, split:]
    precision = symmetrize(np.asarray(np.linalg.inv(s_oo), dtype=np.float64))
    gain = np.swapaxes(np.matmul(precision, s_oc), 1, 2)  # (n, QN, PN)
    n_controlled = n_dofs - n_observed
    per_dof = gain.reshape(n, n_controlled, n_basis, split)
    response = np.einsum("sk,nqkp->nqsp", scored_design, per_dof).reshape(n, -1, split)
    controlled_mean = np.einsum(
        "sk,nqk->nqs", scored_design, mean[:, split:].reshape(n, n_controlled, n_basis)
    ).reshape(n, -1)
    truth = np.swapaxes(samples.controlled, 1, 2).reshape(n, -1)
    own = np.diag(samples.scatter.matrix).reshape(n_dofs, n_basis).mean(axis=1) / rest
    variance = (own + np.var(samples.mean, axis=1) + noise_variance)[n_observed:]
    scale_of_truth = np.repeat(variance, len(scored_design))
    centred = samples.observed - np.einsum(
        "nmk,npk->nmp", samples.design, mean[:, :split].reshape(n, n_observed, n_basis)
    )
    scores = np.zeros((len(noise_scales), n))
    for fraction in FRACTIONS:
        seen = samples.design * (samples.phase <= fraction + 1e-9)[:, :, None]
        gram = np.einsum("nmk,nml->nkl", seen, seen)
        moment = np.einsum("nmk,nmp->npk", seen, centred)
        for index, scale in enumerate(noise_scales):
            r = scale * noise_variance[:n_observed]
            information = precision.copy()
            for p in range(n_observed):
                block = slice(p * n_basis, (p + 1) * n_basis)
                information[:, block, block] += gram / r[p]
            posterior = np.linalg.inv(information)
            update = np.matmul(posterior, (moment / r[None, :, None]).reshape(n, split, 1))
            error = truth - controlled_mean - np.matmul(response, update)[..., 0]
            scores[index] += np.mean(error**2 / scale_of_truth, axis=1) / len(FRACTIONS)
    return scores


def select(
    tasks: Iterable[TaskSamples],
    targets: Iterable[NDArray[np.float64]],
    noise_variance: NDArray[np.float64],
    scored_design: NDArray[np.float64],
) -> tuple[Hyperparameters, tuple[Hyperparameters, ...]]:
    """The best pair of strength and noise scale, and all that were tried.

    Tasks of one demonstration cannot be left out and are ignored; when none can, the middle of both
    grids is taken, with a score of NaN.

    Args:
        tasks: samples of each task; those of many demonstrations may come in parts.
        targets: for each of these, the target covariance without each demonstration in turn,
            (n, D N, D N). Only one is held at a time, so both may be generators.
        noise_variance: residual variance per DOF, (D,).
        scored_design: basis at the scored phases, (s, N).
    """
    parts = []
    for samples, loo_targets in zip(tasks, targets, strict=True):
        if samples.scatter.freedom > 0:
            scores = [
                leave_one_out_scores(samples, loo_targets, noise_variance, scored_design, strength)
                for strength in STRENGTHS
            ]
            parts.append(np.concatenate(scores))
    if not parts:
        middle = Hyperparameters(
            STRENGTHS[len(STRENGTHS) // 2], NOISE_SCALES[len(NOISE_SCALES) // 2], float("nan")
        )
        return middle, (middle,)
    per_demonstration = np.hstack(parts)
    grid = [(strength, scale) for strength in STRENGTHS for scale in NOISE_SCALES]
    tried = [
        Hyperparameters(strength, scale, float(score))
        for (strength, scale), score in zip(grid, per_demonstration.mean(axis=1), strict=True)
    ]
    return min(tried, key=lambda candidate: candidate.score), tuple(tried)


def choose_steady(
    tasks: Mapping[str, TaskStatistics], basis: NormalizedRBFBasis
) -> tuple[Hyperparameters, tuple[Hyperparameters, ...]]:
    """Hyperparameters of the primitives at steady progress, and all that were tried.

    Every demonstration that was kept whole is left out in turn, of very many `MAX_SCORED`, as many
    of each task; the statistics it is predicted from are those of all others.
    """
    most = MAX_SCORED
    if sum(len(task.examples) for task in tasks.values()) > MAX_SCORED:
        most = max(MAX_SCORED // len(tasks), 1)
    parts = [
        (task, task.examples[start : min(start + SCORED_TOGETHER, most)])
        for task in tasks.values()
        for start in range(0, min(len(task.examples), most), SCORED_TOGETHER)
    ]
    floor, noise = variance_scales(tasks)
    return select(
        (_samples(task, examples, basis) for task, examples in parts),
        _targets(parts, tasks, floor),
        noise,
        basis.design_matrix(scored_phases()),
    )


def _targets(
    parts: Iterable[tuple[TaskStatistics, Sequence[TrainingExample]]],
    tasks: Mapping[str, TaskStatistics],
    floor: NDArray[np.float64],
) -> Iterator[NDArray[np.float64]]:
    """Target covariances without each demonstration in turn, part after part."""
    pooled = pooled_moments(tasks.values())
    for task, examples in parts:
        deviations = np.array([example.weights for example in examples]) - task.mean
        yield leave_one_out_targets(task.moments, pooled, deviations, floor)


def _samples(
    task: TaskStatistics, examples: Sequence[TrainingExample], basis: NormalizedRBFBasis
) -> TaskSamples:
    """What the hyperparameters are scored on, of some demonstrations of one task."""
    phase = np.repeat(sample_phases()[None], len(examples), axis=0)
    return TaskSamples(
        task.mean,
        task.moments,
        np.array([e.weights for e in examples]),
        np.array([e.observed for e in examples]),
        basis.design_matrix(phase),
        phase,
        np.array([e.controlled for e in examples]),
    )

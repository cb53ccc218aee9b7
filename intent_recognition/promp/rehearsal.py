# SPDX-License-Identifier: Apache-2.0
"""How well left-out demonstrations are predicted by the very filter that runs online.

It tells whether aligned primitives are worth their while: where people keep to their own pace, the
steady ones predict as well, and say more about the end.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.gaussian.linalg import symmetrize
from intent_recognition.promp.examples import Example, sample_phases, scored_phases
from intent_recognition.promp.forecast import Forecast
from intent_recognition.promp.lead_filter import LeadFilter
from intent_recognition.promp.prior import (
    Scatter,
    leave_one_out_scatter,
    leave_one_out_targets,
    shrunk_covariance,
)
from intent_recognition.promp.progress import reference_phase
from intent_recognition.promp.selection import FRACTIONS
from intent_recognition.promp.statistics import TaskStatistics, pooled_moments

ALIGNED_STRENGTHS = (10.0, 30.0, 100.0)
ALIGNED_NOISE_SCALES = (4.0, 16.0)
"""The grid that the aligned primitives are rehearsed on."""
MAX_REHEARSED = 12
"""Demonstrations of one task that are left out, at most, evenly drawn."""


def rehearse(
    forecast: Forecast,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
    strength: float,
    floor: np.ndarray,
) -> float:
    """Mean squared error of the controlled agent of demonstrations left out.

    Each DOF counts in parts of its variance over all demonstrations; mean over DOFs, phases and
    shares of the movement observed (`selection.FRACTIONS`). The duration is known. Infinite if no
    demonstration can be left out.

    Args:
        forecast: what is rehearsed; its means and covariances are replaced by those without the
            demonstration left out.
        tasks: statistics its means and covariances are from.
        recorded: statistics of the examples as they were recorded, of the same tasks.
        strength: of the covariances' target.
        floor: variance floor per DOF, (D,).
    """
    pooled = pooled_moments(tasks.values())
    truths = [e.controlled for task in recorded.values() for e in task.examples]
    scale = np.maximum(np.var(np.concatenate(truths), axis=0), 1e-12)
    errors = []
    for label, task in tasks.items():
        if task.n < 2:
            continue
        pairs = list(zip(task.examples, recorded[label].examples, strict=True))
        drawn = np.unique(np.linspace(0, len(pairs) - 1, MAX_REHEARSED).round().astype(int))
        left_out = [pairs[index] for index in drawn]
        errors.append(_task_errors(forecast, task, pooled, left_out, strength, floor) / scale)
    return float(np.concatenate(errors).mean()) if errors else np.inf


def _task_errors(
    forecast: Forecast,
    task: TaskStatistics,
    pooled: Scatter,
    left_out: Sequence[tuple[Example, Example]],
    strength: float,
    floor: np.ndarray,
) -> np.ndarray:
    """Mean squared error of each DOF of each demonstration of one task, (n, Q)."""
    size = forecast.n_observed_weights
    deviation = np.array([example.weights for example, _ in left_out]) - task.mean
    targets = leave_one_out_targets(task.moments, pooled, deviation, floor)
    flat = deviation.reshape(len(left_out), -1)
    scatter = leave_one_out_scatter(task.moments, flat)
    covariance = symmetrize(shrunk_covariance(scatter, task.n - 1, targets, strength))
    mean = task.mean.ravel() - flat / (task.n - 1)
    gain = np.swapaxes(
        np.linalg.solve(covariance[:, :size, :size], covariance[:, :size, size:]), 1, 2
    )
    run = LeadFilter(forecast, mean[:, :size], covariance[:, :size, :size], np.ones(len(left_out)))
    dofs = np.arange(forecast.n_observed)
    noise = np.diag(forecast.noise_variance[dofs] * forecast.noise_scale)
    samples = np.stack([recorded.observed for _, recorded in left_out], axis=1)
    truth = np.array([recorded.controlled for _, recorded in left_out])
    errors, shares = [], list(FRACTIONS)
    for phase, values in zip(sample_phases(), samples, strict=True):
        if shares and phase > shares[0]:
            errors.append((_predicted(run, mean, gain) - truth) ** 2)
            shares.pop(0)
        run.observe(float(phase), dofs, values, noise)
    errors += [(_predicted(run, mean, gain) - truth) ** 2 for _ in shares]
    return np.mean(errors, axis=(0, 2))


def _predicted(run: LeadFilter, mean: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """Mean of the controlled agent at the scored phases, (n, s, Q)."""
    forecast, size = run.forecast, run.forecast.n_observed_weights
    change = np.matmul(gain, (run.mean - mean[:, :size])[..., None])[..., 0]
    weights = (mean[:, size:] + change).reshape(len(mean), forecast.n_controlled, -1)
    lead = run.leads_at(scored_phases())
    recorded = np.tile(scored_phases(), (len(mean), 1))
    design = forecast.basis.design_matrix(reference_phase(forecast.progress, recorded))
    row = np.einsum("nse,nsek->nsk", lead, design)
    return np.einsum("nsk,nqk->nsq", row, weights)

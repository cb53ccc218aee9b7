# SPDX-License-Identifier: Apache-2.0
"""The plain way to what a bank of hypotheses says of a movement, for comparison."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from intent_recognition.filtering import MovementFilter, PriorGrid
from intent_recognition.filtering.observation_model import check_observation
from intent_recognition.gaussian import GaussianBatch, LinearMeasurement
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.signals.observation import Observation


class Bank(NamedTuple):
    """Filtered observed weights of B hypotheses, and the density of all observations under them."""

    mean: np.ndarray
    covariance: np.ndarray
    log_evidence: np.ndarray


def bank_of(run: MovementFilter) -> Bank:
    """All hypotheses of a filter, none of which lags any more."""
    index = [run.rows_of(task) for task in range(run.library.n_tasks + 1)]
    tasks = [run.table.courses(some).moments() for some in index]
    mean, covariance = (np.concatenate(part) for part in zip(*tasks, strict=True))
    return Bank(mean, covariance, run.log_evidence)


def start_bank(library: TaskLibrary, hypotheses: PriorGrid) -> Bank:
    """The bank before any observation."""
    return Bank(
        np.repeat(library.observed_mean, hypotheses.n_scales, axis=0),
        np.repeat(library.observed_covariance, hypotheses.n_scales, axis=0),
        np.zeros(len(hypotheses.duration_s)),
    )


def run_bank(
    library: TaskLibrary, hypotheses: PriorGrid, observations: Iterable[Observation], onset_ns: int
) -> Bank:
    """The bank after a stretch of observations that begins at onset."""
    run = MovementFilter(library, hypotheses, onset_ns)
    for observation in observations:
        run.observe(observation)
    return bank_of(run)


def condition_bank(
    bank: Bank, dofs: np.ndarray, rows: np.ndarray, values: np.ndarray, noise_covariance: np.ndarray
) -> Bank:
    """Every hypothesis conditioned on one observation; the argument is not changed.

    Args:
        bank: B hypotheses.
        dofs: index of the DOF behind each observed value, (m,).
        rows: row of the observation matrix within a DOF's block, shared by the DOFs, (B, 1, N).
        values: (m,).
        noise_covariance: (m, m) or one per hypothesis, (B, m, m).
    """
    check_observation(dofs, values, noise_covariance)
    n, n_basis = len(bank.mean), rows.shape[-1]
    rows = np.broadcast_to(rows, (n, 1, n_basis))
    block = GaussianBatch.of(bank.mean, bank.covariance, n_basis)
    density, _ = block.condition(LinearMeasurement(dofs, rows, values, noise_covariance))
    return Bank(*block.moments(), bank.log_evidence + density)

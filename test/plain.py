# SPDX-License-Identifier: Apache-2.0
"""The plain way to what a bank of hypotheses says of a movement, for comparison."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from intent_recognition.filtering import MovementFilter, PriorGrid
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


def run_bank(
    library: TaskLibrary, hypotheses: PriorGrid, observations: Iterable[Observation], onset_ns: int
) -> Bank:
    """The bank after a stretch of observations that begins at onset."""
    run = MovementFilter(library, hypotheses, onset_ns)
    for observation in observations:
        run.observe(observation)
    return bank_of(run)

# SPDX-License-Identifier: Apache-2.0
"""The filter along held-out demonstrations, all at once, as it runs online."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import Deviations, Step, condition_on
from intent_recognition.gaussian import Gaussian, GaussianBatch, make_state
from intent_recognition.learning.examples import (
    SAMPLES_PER_MOVEMENT,
    SAMPLES_USED,
    TrainingExample,
    sample_phases,
)
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import (
    TaskLibrary,
    deviation_prior,
    deviation_transition,
    reference_phase,
)

MAX_RIVALS = 8
"""Other tasks, those with the nearest means, that a demonstration is compared with. Convention: it
bounds the time; tasks farther away have no evidence to speak of."""
MAX_FLOATS = 2**23
"""Numbers in the covariances filtered at a time. Convention: 64 MB."""
T = TypeVar("T")


class Progress(NamedTuple):
    """n hypotheses after some samples.

    Attributes:
        n_samples: how many.
        log_evidence: log density of the samples, (n,).
        weights: the filtered observed weights; pending downdates are applied.
        deviations: what was believed of the phase deviations.
    """

    n_samples: int
    log_evidence: NDArray[np.float64]
    weights: GaussianBatch
    deviations: Deviations


def filter_samples(
    library: TaskLibrary,
    prior: Gaussian,
    pace: NDArray[np.float64],
    values: NDArray[np.float64],
) -> Iterator[Progress]:
    """Filter samples at `sample_phases` of demonstrations; yields after each sample.

    Args:
        library: whose basis, noise and phase deviation are used.
        prior: of the observed weights, (n, P N) and (n, P N, P N).
        pace: duration of the demonstration in parts of the hypothesis' duration, (n,).
        values: observed DOFs, (m, n, P).
    """
    model, basis, n = library.phase_deviation, library.basis, len(pace)
    weights = GaussianBatch(make_state(*prior, basis.n_basis), basis.n_basis)
    deviation = np.tile(deviation_prior(model), (n, 1))
    dofs = np.arange(library.n_observed)
    interval_s = library.correlation_time_s * SAMPLES_PER_MOVEMENT / SAMPLES_USED
    noise = library.noise_covariance(dofs, interval_s)
    evidence, kept = np.zeros(n), list[tuple[NDArray[np.float64], NDArray[np.float64]]]()
    phases = sample_phases()
    different, place = np.unique(pace, return_inverse=True)
    for k, phase in enumerate(phases):
        rows = basis.design_matrix(reference_phase(model, phase * different))[place]
        moved = None
        if k and deviation.shape[1] > 1:
            moved = deviation_transition(model, (phase - phases[k - 1]) * different)[place]
        step = Step(dofs, rows, values[k], noise, moved, model.evidence, library.evidence_freedom)
        density, likelihood = condition_on(weights, deviation, step)
        evidence += density
        kept.append((deviation.copy(), likelihood))
        filtered, weighed = (np.array(part) for part in zip(*kept, strict=True))
        yield Progress(k + 1, evidence, weights, Deviations(phases[: k + 1], filtered, weighed))


def evenly(items: Sequence[T], most: int) -> list[T]:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)]


def nearest_tasks(
    tasks: Sequence[TaskStatistics], example: TrainingExample, others: NDArray[np.int64]
) -> NDArray[np.int64]:
    """The tasks whose mean weights come nearest to an example's, at most `MAX_RIVALS`."""
    if len(others) <= MAX_RIVALS:
        return others
    n_observed = example.observed.shape[1]
    apart = [np.sum((tasks[k].mean - example.weights)[:n_observed] ** 2) for k in others]
    return others[np.argsort(apart)[:MAX_RIVALS]]

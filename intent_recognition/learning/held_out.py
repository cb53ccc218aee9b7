# SPDX-License-Identifier: Apache-2.0
"""The filter along held-out demonstrations, all at once, as it runs online."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple, TypeVar

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.filtering import Deviations, deviations_at
from intent_recognition.gaussian import Gaussian, GaussianBatch, LinearMeasurement
from intent_recognition.learning.examples import (
    SAMPLES_PER_MOVEMENT,
    SAMPLES_USED,
    TrainingExample,
    sample_phases,
    scored_phases,
)
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import (
    TaskLibrary,
    deviation_prior,
    deviation_transition,
    reference_phase,
    steady_phase,
)
from intent_recognition.signals import commensurate

MAX_RIVALS = 8
"""Other tasks, those with the nearest means, that a demonstration is compared with. Convention: it
bounds the time; tasks farther away have no evidence to speak of."""
MAX_FLOATS = 2**19
"""Numbers in the covariances filtered at a time. Measured: 4 MB take about the least time."""
T = TypeVar("T")


class FilteredSamples(NamedTuple):
    """n hypotheses after some samples.

    Attributes:
        n_samples: how many.
        log_evidence: log density of the samples, (n,).
        weights: the filtered observed weights.
        believed: after each sample, the probability of each phase deviation and what the sample
            weighed them with, (n, E) each.
    """

    n_samples: int
    log_evidence: Floats
    weights: GaussianBatch
    believed: Sequence[tuple[Floats, Floats]]

    def deviations(self, some: Integers) -> Deviations:
        """What was believed of the phase deviations of some hypotheses, (k,)."""
        filtered, likelihood = (
            np.array([part[some] for part in parts]) for parts in zip(*self.believed, strict=True)
        )
        return Deviations(sample_phases()[: self.n_samples], filtered, likelihood)


class LeftOutExample(NamedTuple):
    """One demonstration, and its task without it.

    Attributes:
        task: number of its task.
        mean: weights of its task, (D N,).
        covariance: of the observed weights, shared by the tasks, (P N, P N).
        gain: of the controlled weights on the observed ones, (Q N, P N).
        rivals: numbers of the other tasks it is compared with.
        rival_means: their observed weights, without the person who was left out, (r, P N).
        observed: its samples, (m, P).
        seen: the same at the scored phases, (s, P).
        truth: of the controlled DOFs there, (s, Q).
        log_duration: mean of the logarithms of the others' durations [log s].
    """

    task: int
    mean: Floats
    covariance: Floats
    gain: Floats
    rivals: Integers
    rival_means: Floats
    observed: Floats
    seen: Floats
    truth: Floats
    duration_s: float
    log_duration: float


def filter_samples(
    library: TaskLibrary, prior: Gaussian, pace: Floats, relative: Floats, values: Floats
) -> Iterator[FilteredSamples]:
    """Filter samples at `sample_phases` of demonstrations; yields after each sample.

    Args:
        library: whose basis, noise and phase deviation are used.
        prior: of the observed weights, (n, P N) and (n, P N, P N).
        pace: duration of the demonstration in parts of the hypothesis' duration, (n,).
        relative: the latter in parts of what its task usually takes, (n,).
        values: observed DOFs, (m, n, P).
    """
    model, basis, n = library.phase_deviation, library.basis, len(pace)
    weights = GaussianBatch.of(*prior, basis.n_basis)
    deviation = np.tile(deviation_prior(model), (n, 1))
    dofs = np.arange(library.n_observed)
    interval_s = library.correlation_time_s * SAMPLES_PER_MOVEMENT / SAMPLES_USED
    noise = library.noise_covariance(dofs, interval_s)
    evidence, believed = np.zeros(n), list[tuple[Floats, Floats]]()
    phases = sample_phases()
    different, place = np.unique([pace, relative], axis=1, return_inverse=True)
    between = deviation_transition(model, different[0] / len(phases))[place]  # evenly spaced
    for k, phase in enumerate(phases):
        rows = basis.design_matrix(reference_phase(model, phase * different[0], different[1]))[
            place
        ]
        freedom = library.evidence_freedom if k else inf  # as in `ObservationModel.measurement`
        moved = between if k else None
        one = LinearMeasurement(dofs, rows, values[k], noise, moved, model.evidence, freedom)
        density, likelihood = weights.condition(one, deviation)
        evidence = evidence + density  # what was yielded stays
        believed.append((deviation.copy(), likelihood))
        yield FilteredSamples(k + 1, evidence, weights, believed)


def samples_at(shares: Sequence[float]) -> list[int]:
    """After how many samples these shares of a movement were seen."""
    return [round(share * SAMPLES_USED) for share in shares]


def predict_agents(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    progress: FilteredSamples,
    own: Integers,
    pace: Floats,
    relative: Floats,
) -> tuple[Floats, Floats]:
    """Means of both agents at the scored phases, (n, S, s, P) and (n, S, s, Q).

    Args:
        library: whose basis and phase deviation are used.
        left_out: n demonstrations.
        progress: the filter after some of their samples.
        own: its hypotheses of each demonstration's own task, (n, S).
        pace: of these, as in `filter_samples`, (n, S).
        relative: likewise.
    """
    model, basis, size = library.phase_deviation, library.basis, library.n_observed_weights
    mean = np.array([one.mean for one in left_out])[:, None]
    gain = np.array([one.gain for one in left_out])
    filtered = progress.weights.mean[own]
    change = (filtered - mean[..., :size]) @ np.swapaxes(gain, 1, 2)
    weights = np.concatenate([filtered, mean[..., size:] + change], axis=2)
    deviations = progress.deviations(own.ravel())
    pace, relative = pace.reshape(-1, 1), relative.reshape(-1, 1)
    share = deviations_at(model, 1.0 / pace[:, 0], deviations, scored_phases())
    phase = pace * scored_phases()
    rows = np.einsum(
        "nse,nsek->nsk", share, basis.design_matrix(reference_phase(model, phase, relative))
    )
    of_dofs = np.swapaxes(weights.reshape(len(pace), -1, basis.n_basis), 1, 2)
    observed = rows @ of_dofs[..., : library.n_observed]
    if not model.controlled_follows:
        rows = basis.design_matrix(steady_phase(model, phase, relative))
    controlled = rows @ of_dofs[..., library.n_observed :]
    shape = (*own.shape, phase.shape[1], -1)
    return observed.reshape(shape), controlled.reshape(shape)


def evenly(items: Sequence[T], most: int) -> list[T]:
    """At most so many of the items, evenly spaced."""
    count = min(len(items), most)
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)]


def paired_examples(
    tasks: Mapping[str, TaskStatistics], recorded: Mapping[str, TaskStatistics], most: int
) -> list[tuple[int, TrainingExample, TrainingExample]]:
    """Demonstrations, evenly drawn from all tasks: number of the task, as learned, as recorded.

    Args:
        tasks: statistics that primitives are built from.
        recorded: of the same labels or more, of the examples as they were recorded.
        most: how many.
    """
    labels = list(recorded)
    pairs = [
        (labels.index(label), example, as_recorded)
        for label, task in tasks.items()
        for example, as_recorded in zip(task.examples, recorded[label].examples, strict=True)
    ]
    return evenly(pairs, most)


def nearest_tasks(
    tasks: Sequence[TaskStatistics],
    example: TrainingExample,
    others: Integers,
    units: Sequence[str],
) -> Integers:
    """The tasks whose mean weights come nearest to an example's, at most `MAX_RIVALS`.

    Args:
        tasks: their statistics.
        example: what they are compared with.
        others: numbers of those that are compared.
        units: of the observed DOFs, (P,); distances in incommensurate ones are each divided by
            their mean.
    """
    if len(others) <= MAX_RIVALS:
        return others
    apart = np.zeros(len(others))
    for dofs in commensurate(units):
        squares = [np.sum((tasks[k].mean - example.weights)[dofs] ** 2) for k in others]
        apart += len(dofs) * np.array(squares) / (np.mean(squares) or 1.0)
    return others[np.argsort(apart)[:MAX_RIVALS]]

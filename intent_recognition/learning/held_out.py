# SPDX-License-Identifier: Apache-2.0
"""Run the filter along held-out demonstrations in batches, at 60 evenly spaced samples."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.filtering import Deviations, deviations_at
from intent_recognition.gaussian import Gaussian, GaussianBatch, LinearMeasurement
from intent_recognition.learning.examples import (
    SAMPLES_PER_MOVEMENT,
    SAMPLES_USED,
    sample_phases,
    scored_phases,
)
from intent_recognition.learning.held_out_examples import LeftOutExample
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.promp import (
    TaskLibrary,
    deviation_prior,
    deviation_transition,
    reference_phase,
    steady_phase,
)

MAX_FLOATS = 2**19
"""Numbers in the covariances filtered at a time; 4 MB were measured to take the least time."""


class FilteredSamples(NamedTuple):
    """State of n hypotheses after some samples."""

    n_samples: int  # number of samples so far
    log_evidence: Floats  # log density of the samples, (n,)
    weights: GaussianBatch  # the filtered observed weights
    # after each sample, probability and likelihood of each phase deviation, (n, E) each
    believed: Sequence[tuple[Floats, Floats]]

    def deviations(self, some: Integers) -> Deviations:
        """Filtered phase deviations of the hypotheses with indices `some`, (k,)."""
        filtered, likelihood = (
            np.array([part[some] for part in parts]) for parts in zip(*self.believed, strict=True)
        )
        return Deviations(sample_phases()[: self.n_samples], filtered, likelihood)


class Followed(NamedTuple):
    """The S hypotheses of each of n demonstrations' own task, after some samples."""

    progress: FilteredSamples  # all hypotheses, those of other tasks included
    own: Integers  # indices of the own tasks' hypotheses in `progress`, (n, S)
    pace: Floats  # pace of these hypotheses, as in `filter_samples`, (n, S)
    relative: Floats  # relative duration of these hypotheses, as in `filter_samples`, (n, S)


def filter_samples(
    library: TaskLibrary,
    prior: Gaussian,
    pace: Floats,
    relative: Floats,
    values: Floats,
    first: int = 0,
) -> Iterator[FilteredSamples]:
    """Filter samples of demonstrations at `sample_phases`; yield the state after each sample.

    Args:
        library: provides basis, noise and phase deviation.
        prior: prior of the observed weights, (n, P N) and (n, P N, P N).
        pace: duration of the demonstration divided by that of the hypothesis, (n,).
        relative: duration of the hypothesis divided by the usual one of its task, (n,).
        values: values of the observed DOFs, (m, n, P).
        first: number of samples at the beginning that are not used.
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
    for k, phase in enumerate(phases[first:], first):
        rows = basis.design_matrix(reference_phase(model, phase * different[0], different[1]))[
            place
        ]
        later = k > first
        freedom = library.evidence_freedom if later else inf  # as in `ObservationModel.measurement`
        moved = between if later else None
        one = LinearMeasurement(dofs, rows, values[k], noise, moved, model.evidence, freedom)
        density, likelihood = weights.condition(one, deviation)
        evidence = evidence + density  # a new array: the old one was yielded
        believed.append((deviation.copy(), likelihood))
        yield FilteredSamples(k + 1, evidence, weights, believed)


def batches_of(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], n_hypotheses: int = 0
) -> Iterator[Sequence[LeftOutExample]]:
    """Split demonstrations into batches whose covariances hold at most `MAX_FLOATS` numbers.

    Each demonstration has `n_hypotheses` or, if that is 0, its own task and its rivals.
    """
    each = n_hypotheses or 1 + max(len(one.rivals) for one in left_out)
    most = max(1, MAX_FLOATS // (library.n_observed_weights**2 * each))
    for first in range(0, len(left_out), most):
        yield left_out[first : first + most]


def follow_known(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> Iterator[Followed]:
    """Filter left-out demonstrations of known duration under their own tasks and the rivals.

    Yields:
        The hypotheses of the own tasks after each sample, with S = 1.
    """
    prior, own = _priors(library, left_out, tasks)
    sizes = np.diff(np.append(own, len(prior.mean)))
    samples = np.repeat(np.array([one.observed for one in left_out]), sizes, axis=0)
    usual_s = [library.usual_s[[one.task, *one.rivals]] for one in left_out]
    relative = np.repeat([one.duration_s for one in left_out], sizes) / np.concatenate(usual_s)
    pace = np.ones(len(relative))
    own = own[:, None]
    for progress in filter_samples(library, prior, pace, relative, np.swapaxes(samples, 0, 1)):
        yield Followed(progress, own, pace[own], relative[own])


def _priors(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], tasks: Mapping[str, TaskStatistics]
) -> tuple[Gaussian, Integers]:
    """Priors of the observed weights under own tasks and rivals; indices of the own tasks."""
    size, count = library.n_observed_weights, np.array([task.n for task in tasks.values()])
    mean, covariance = [], []
    for one in left_out:
        n = np.r_[max(count[one.task] - 1, 1), count[one.rivals]]
        mean.append(np.vstack([one.mean[:size], one.rival_means]))
        covariance.append(one.covariance * (1.0 + 1.0 / n)[:, None, None])
    own = np.cumsum([0, *(len(part) for part in mean[:-1])])
    return Gaussian(np.concatenate(mean), np.concatenate(covariance)), own


def samples_at(shares: Sequence[float]) -> list[int]:
    """Numbers of samples after which these shares of a movement were seen."""
    return [round(share * SAMPLES_USED) for share in shares]


def predict_agents(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    followed: Followed,
    phases: Floats | None = None,
    *,
    start_known: bool = False,
) -> tuple[Floats, Floats]:
    """Means of both agents at phases of the demonstrations, (n, S, s, P) and (n, S, s, Q).

    Args:
        library: provides basis and phase deviation.
        left_out: n demonstrations.
        followed: hypotheses of their own tasks after some samples.
        phases: the phases, (s,); the scored ones when None.
        start_known: condition the controlled agent on its start.
    """
    phases = scored_phases() if phases is None else phases
    size = library.n_observed_weights
    mean = np.array([one.mean for one in left_out])[:, None]
    gain = np.array([one.rule.matrix for one in left_out])
    filtered = followed.progress.weights.mean[followed.own]
    change = (filtered - mean[..., :size]) @ np.swapaxes(gain, 1, 2)
    following = mean[..., size:] + change
    if start_known:
        following = following + _from_start(library, left_out, followed, following)
    weights = np.concatenate([filtered, following], axis=2)
    of_observed, of_controlled = expected_rows(library, left_out, followed, phases)
    of_dofs = np.swapaxes(weights.reshape(followed.own.size, -1, library.basis.n_basis), 1, 2)
    observed = of_observed @ of_dofs[..., : library.n_observed]
    controlled = of_controlled @ of_dofs[..., library.n_observed :]
    shape = (*followed.own.shape, len(phases), -1)
    return observed.reshape(shape), controlled.reshape(shape)


def _from_start(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], followed: Followed, weights: Floats
) -> Floats:
    """Change of the controlled weights (n, S, Q N) given the agent's start, of the same shape."""
    shape, q = weights.shape, library.n_controlled
    row = library.basis.design_matrix(np.zeros(1))[0]
    _, spread = followed.progress.weights.moments(followed.own.ravel())
    spread = spread.reshape(*shape[:2], *spread.shape[1:])
    gain = np.array([one.rule.matrix for one in left_out])[:, None]
    rest = np.array([one.rule.covariance for one in left_out])[:, None]

    def at_start(matrix: Floats) -> Floats:
        """Rows of the start, (..., Q, x), from those of the controlled weights, (..., Q N, x)."""
        return np.einsum(
            "k,...qkx->...qx", row, matrix.reshape(*matrix.shape[:-2], q, len(row), -1)
        )

    cross = (at_start(gain) @ spread @ np.swapaxes(gain, -1, -2)) + at_start(rest)
    cross = np.swapaxes(cross, -1, -2)  # (n, S, Q N, Q)
    covariance = at_start(cross) + np.diag(library.control_noise_variance())
    start = np.array([one.poses[0] for one in left_out])[:, None, :, None]
    innovation = np.linalg.solve(covariance, start - at_start(weights[..., None]))
    return np.asarray((cross @ innovation)[..., 0])


def expected_rows(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], followed: Followed, phases: Floats
) -> tuple[Floats, Floats]:
    """Basis functions of both agents at phases of demonstrations, expected over phase deviations.

    Those of the observed and of the controlled DOFs, (n S, s, N) each, are returned. The arguments
    are those of `predict_agents`.
    """
    model, basis = library.phase_deviation, library.basis
    pace, relative = followed.pace.reshape(-1, 1), followed.relative.reshape(-1, 1)
    deviations = followed.progress.deviations(followed.own.ravel())
    share = deviations_at(model, 1.0 / pace[:, 0], deviations, phases)
    phase = pace * phases
    rows = np.einsum(
        "nse,nsek->nsk", share, basis.design_matrix(reference_phase(model, phase, relative))
    )
    of_controlled = rows
    if not model.controlled_follows:
        of_controlled = basis.design_matrix(steady_phase(model, phase, relative))
    duration_s = np.repeat([one.duration_s for one in left_out], followed.own.shape[1])
    later = library.delay_s * (pace * (1.0 - relative))[:, 0] / duration_s
    factor = relative[:, 0] ** library.displacement_exponent
    return rows, of_controlled @ basis.shifting(later) @ basis.scaling(factor)

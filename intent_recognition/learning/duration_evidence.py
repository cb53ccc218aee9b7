# SPDX-License-Identifier: Apache-2.0
"""How much evidence counts in the posterior of a movement's duration, by held-out validation.

Left-out demonstrations are filtered under several durations, as online. The exponent of the
evidence and the coupling of the residuals (`learning.coupling`) are those under which the
controlled agent is predicted best at true times.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import deviations_at, duration_offsets
from intent_recognition.gaussian import Gaussian
from intent_recognition.learning.coupling import HeldOutResiduals, learn_coupling
from intent_recognition.learning.examples import scored_phases
from intent_recognition.learning.held_out import FilteredSamples, LeftOutExample, filter_samples
from intent_recognition.promp import ResidualCoupling, TaskLibrary, reference_phase

EXPONENTS = (0.2, 0.5, 1.0)
"""Exponents of the evidence that are tried, the default first (docs/decisions/one_filter.md)."""
N_DURATIONS = 7
"""Durations under which a demonstration is filtered. Convention: it bounds the time."""


class Followed(NamedTuple):
    """n left-out demonstrations under S durations, after each of f shares.

    Attributes:
        log_evidence: (f, n, S).
        observed: means at the scored phases, (f, n, S, s, P).
        controlled: (f, n, S, s, Q).
    """

    log_evidence: NDArray[np.float64]
    observed: NDArray[np.float64]
    controlled: NDArray[np.float64]


def follow(
    library: TaskLibrary, left_out: Sequence[LeftOutExample], shares: Sequence[float]
) -> Followed:
    """Filter left-out demonstrations under their own task, their durations unknown."""
    offsets, _ = duration_offsets(N_DURATIONS)
    size, n = library.n_observed_weights, len(left_out)
    std = library.log_duration_std[[one.task for one in left_out]]
    usual = np.array([one.log_duration for one in left_out])[:, None] + std[:, None] * offsets
    pace = (np.array([one.duration_s for one in left_out])[:, None] / np.exp(usual)).ravel()
    mean = np.array([one.mean for one in left_out])
    n_others = np.maximum(library.n_demonstrations[[one.task for one in left_out]] - 1, 1)
    covariance = np.array([one.covariance for one in left_out])
    covariance = covariance * (1.0 + 1.0 / n_others)[:, None, None]
    prior = Gaussian(
        np.repeat(mean[:, :size], N_DURATIONS, axis=0), np.repeat(covariance, N_DURATIONS, axis=0)
    )
    samples = np.repeat(np.array([one.observed for one in left_out]), N_DURATIONS, axis=0)
    samples, remaining, found = np.swapaxes(samples, 0, 1), list(shares), []
    gain = np.array([one.gain for one in left_out])
    for progress in filter_samples(library, prior, pace, samples):
        seen = (progress.n_samples + 0.5) / len(samples)
        while remaining and (seen > remaining[0] or progress.n_samples == len(samples)):
            remaining.pop(0)
            filtered = progress.weights.mean.reshape(n, N_DURATIONS, size)
            change = (filtered - mean[:, None, :size]) @ np.swapaxes(gain, 1, 2)
            weights = np.concatenate([filtered, mean[:, None, size:] + change], axis=2)
            paths = _paths(library, progress, pace, weights.reshape(len(pace), -1))
            shape = (n, N_DURATIONS, len(scored_phases()), -1)
            found.append(
                (progress.log_evidence.reshape(n, -1), *(path.reshape(shape) for path in paths))
            )
    return Followed(*(np.array(part) for part in zip(*found, strict=True)))


def _paths(
    library: TaskLibrary,
    progress: FilteredSamples,
    pace: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Means of both agents at the scored phases of n hypotheses, (n, s, P) and (n, s, Q)."""
    model, basis = library.phase_deviation, library.basis
    everything = np.arange(len(pace))
    share = deviations_at(model, 1.0 / pace, progress.deviations(everything), scored_phases())
    phase = pace[:, None] * scored_phases()
    rows = np.einsum("nse,nsek->nsk", share, basis.design_matrix(reference_phase(model, phase)))
    of_dofs = np.swapaxes(weights.reshape(len(pace), -1, basis.n_basis), 1, 2)
    observed = rows @ of_dofs[..., : library.n_observed]
    if not model.controlled_follows:
        rows = basis.design_matrix(np.minimum(phase, 1.0))
    return observed, rows @ of_dofs[..., library.n_observed :]


def choose_duration_evidence(
    library: TaskLibrary,
    left_out: Sequence[LeftOutExample],
    shares: Sequence[float],
    variance: NDArray[np.float64],
    at_once: int,
) -> tuple[float, ResidualCoupling]:
    """The exponent, and the coupling of what it leaves unexplained.

    Another one than the first takes the place of it where it predicts better by more than the
    standard error over the demonstrations.

    Args:
        library: whose basis, noise and timing are used.
        left_out: the demonstrations.
        shares: of the movement after which it is predicted, (f,).
        variance: by which squares of the controlled DOFs are divided, (Q,).
        at_once: demonstrations filtered at a time, under all their durations.
    """
    parts = [
        follow(library, left_out[first : first + at_once], shares)
        for first in range(0, len(left_out), at_once)
    ]
    log_evidence, observed, controlled = (
        np.concatenate(part, axis=1) for part in zip(*parts, strict=True)
    )
    log_prior = duration_offsets(N_DURATIONS)[1]
    tasks = np.array([one.task for one in left_out])
    found: list[tuple[NDArray[np.float64], float, ResidualCoupling]] = []
    for exponent in EXPONENTS:
        log_weight = log_prior + exponent * log_evidence
        weight = np.exp(log_weight - log_weight.max(axis=2, keepdims=True))
        weight /= weight.sum(axis=2, keepdims=True)
        human, robot = (
            np.einsum("fnh,fnhsd->fnsd", weight, path) for path in (observed, controlled)
        )
        residuals = HeldOutResiduals(
            tasks,
            scored_phases(),
            np.array(shares),
            np.array([one.seen for one in left_out]) - human,
            np.array([one.truth for one in left_out]) - robot,
        )
        coupling, left = learn_coupling(residuals, variance, library.durations_s)
        found.append((np.mean(left / variance, axis=1), exponent, coupling))
    default, best = found[0][0], min(found, key=lambda one: one[0].mean())
    gained = default - best[0]
    clear = gained.mean() > gained.std() / np.sqrt(len(gained))
    _, exponent, coupling = best if clear else found[0]
    return exponent, coupling

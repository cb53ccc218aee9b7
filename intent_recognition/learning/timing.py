# SPDX-License-Identifier: Apache-2.0
"""Timing of demonstrations: templates to align with, and deviations from steady progress.

Templates and the standard deviation of the phase deviation are estimated once and are part of the
preprocessing; a later recording is warped onto the same template by itself (Maeda et al. 2014, part
III-E).

A person whose phase deviates by e from steady progress u is, to first order, at
mu(u + e) = mu(u) + e mu'(u). A hesitation can happen anywhere, but a few demonstrations show only
a few of them. `timing_covariance` is the covariance that the phase deviation implies; a part of it
is added to the covariances that tasks are recognised by (docs/decisions/hesitations.md).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from intent_recognition.alignment import Template, Warp, align, align_to, even_trajectory
from intent_recognition.promp import OWN_COVARIANCE_SHARE, NormalizedRBFBasis, PhaseDeviation
from intent_recognition.signals import Demonstration

N_DEVIATION_PHASES = 51
"""Evenly spaced phases at which the standard deviation of the phase deviation is kept. Convention.
"""
MIN_DEVIATION_STD = 0.004
"""Smallest standard deviation of the phase deviation, a share of the duration. Convention."""
DEFAULT_DEVIATION_STD = 0.03
"""The largest along the movement where no task has two recordings, a share of the duration.
Convention."""
DEVIATION_CORRELATION = 0.4
"""Correlation length of the phase deviation, in phase (docs/prediction.md)."""
DEVIATION_EVIDENCE = 0.3
"""Exponent of the evidence on the phase deviation, in (0, 1] (docs/prediction.md)."""
UNSHOWN_DEVIATION_SHARE = 0.5
"""Share of a phase deviation that the demonstrations' own covariance does not contain
(docs/decisions/hesitations.md)."""


@dataclass(frozen=True, eq=False)
class Timing:
    """Templates of tasks, and how far the phase of recordings deviates from steady progress.

    Attributes:
        templates: of each label that had two recordings.
        deviation_std: standard deviation of the phase deviation at even recorded phases, (U,).
    """

    templates: Mapping[str, Template]
    deviation_std: NDArray[np.float64]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Timing) or self.templates.keys() != other.templates.keys():
            return False
        pairs = [(self.deviation_std, other.deviation_std)]
        for label, template in self.templates.items():
            pairs += zip(template, other.templates[label], strict=True)
        return all(np.array_equal(ours, theirs) for ours, theirs in pairs)

    __hash__ = None  # type: ignore[assignment]  # arrays have no hash

    @property
    def phase_deviation(self) -> PhaseDeviation:
        """The prior of a person's phase deviation."""
        return PhaseDeviation(self.deviation_std, DEVIATION_CORRELATION, DEVIATION_EVIDENCE)

    def warps(self, recordings: Sequence[Demonstration]) -> list[Warp]:
        """From reference phase to the recorded phase of each; the identity without a template."""
        found = [Warp.identity()] * len(recordings)
        for label, indices in _by_task(recordings).items():
            if label in self.templates:
                paths = [_path(recordings[index]) for index in indices]
                warps = align_to(self.templates[label], paths)
                for index, warp in zip(indices, warps, strict=True):
                    found[index] = warp
        return found


def estimate_timing(recordings: Sequence[Demonstration]) -> Timing:
    """Templates and phase deviations of labelled recordings that are cut to their movements.

    Recordings without a sample of some signal are ignored.
    """
    usable = [recorded for recorded in recordings if _has_samples(recorded)]
    templates, deviations = {}, []
    for label, indices in _by_task(usable).items():
        if len(indices) < 2:
            continue
        alignment = align([_path(usable[index]) for index in indices])
        templates[label] = alignment.template
        deviations.append(_deviations(alignment.warps))
    return Timing(dict(sorted(templates.items())), _deviation_std(deviations))


def _deviations(warps: Iterable[Warp]) -> NDArray[np.float64]:
    """Reference phase less recorded phase of each warp at even recorded phases, (n, U)."""
    recorded = np.linspace(0.0, 1.0, N_DEVIATION_PHASES)
    return np.array([np.clip(warp.inverse(recorded), 0.0, 1.0) for warp in warps]) - recorded


def _deviation_std(deviations: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Standard deviation of the phase deviation, pooled over tasks, (U,).

    Recordings begin and end with the movement, where the deviation is zero: the variance is that
    of a bridge, c^2 4 u (1 - u), with c fitted to the warps by least squares.
    """
    phase = np.linspace(0.0, 1.0, N_DEVIATION_PHASES)
    bridge = 4.0 * phase * (1.0 - phase)
    largest = DEFAULT_DEVIATION_STD
    if deviations:
        inner = slice(1, -1)
        freedom = sum(len(rows) - 1 for rows in deviations)
        variance = sum(np.sum(rows**2, axis=0) for rows in deviations) / freedom
        largest = np.sqrt(np.mean(variance[inner] * bridge[inner]) / np.mean(bridge[inner] ** 2))
    return np.maximum(largest * np.sqrt(bridge), MIN_DEVIATION_STD)


def _by_task(recordings: Sequence[Demonstration]) -> dict[str, list[int]]:
    groups: dict[str, list[int]] = {}
    for index, recorded in enumerate(recordings):
        groups.setdefault(str(recorded.task), []).append(index)
    return groups


def _has_samples(recorded: Demonstration) -> bool:
    start_ns, end_ns = recorded.start_ns, recorded.end_ns
    return end_ns > start_ns and all(
        signal.between(start_ns, end_ns).stamps_ns.size
        for signal in (*recorded.observed, *recorded.controlled)
    )


def _path(recorded: Demonstration) -> NDArray[np.float64]:
    """All DOFs at even recorded phases, (T, D)."""
    signals = (*recorded.observed, *recorded.controlled)
    return even_trajectory(signals, recorded.start_ns, recorded.end_ns)


def timing_covariance(
    basis: NormalizedRBFBasis, mean: NDArray[np.float64], phase_deviation: PhaseDeviation
) -> NDArray[np.float64]:
    """Covariance of the weights that comes from the phase deviation alone, (P N, P N).

    Positive semidefinite, by the Schur product theorem.

    Args:
        basis: N basis functions.
        mean: mean weights, grouped by DOF, (P N,).
        phase_deviation: its prior.
    """
    at_centers = basis.design_matrix(basis.centers)
    slope = basis.derivative_matrix(basis.centers) @ mean.reshape(-1, basis.n_basis).T
    weights, *_ = np.linalg.lstsq(at_centers, slope, rcond=None)
    even = np.linspace(0.0, 1.0, len(phase_deviation.deviation_std))
    deviation = (weights.T * np.interp(basis.centers, even, phase_deviation.deviation_std)).ravel()
    apart = np.abs(basis.centers[:, None] - basis.centers)
    correlation = np.exp(-apart / phase_deviation.correlation)
    n_dofs = len(mean) // basis.n_basis
    return np.outer(deviation, deviation) * np.tile(correlation, (n_dofs, n_dofs))


def mean_timing_covariance(
    basis: NormalizedRBFBasis, means: Sequence[NDArray[np.float64]], phase_deviation: PhaseDeviation
) -> NDArray[np.float64]:
    """The mean of `timing_covariance` over tasks of these mean weights, (P N, P N)."""
    first, *others = (timing_covariance(basis, mean, phase_deviation) for mean in means)
    return sum(others, first) / len(means)


def unshown_timing_covariance(
    own: NDArray[np.float64], shared: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The part of the timing covariance that a task's demonstrations have not shown.

    Half is the task's own and half is shared, as in the covariance that it is added to.

    Args:
        own: `timing_covariance` of the task, (P N, P N).
        shared: `mean_timing_covariance` of all tasks, (P N, P N).
    """
    mixed = OWN_COVARIANCE_SHARE * own + (1.0 - OWN_COVARIANCE_SHARE) * shared
    return UNSHOWN_DEVIATION_SHARE**2 * mixed

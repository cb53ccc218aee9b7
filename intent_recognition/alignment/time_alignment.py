# SPDX-License-Identifier: Apache-2.0
"""Time alignment of the demonstrations of one task (Maeda et al. 2014, part III-E).

People perform a movement at different speeds. Each demonstration gets a `Warp` that aligns it with
a template: one of the demonstrations (as in the paper), a given trajectory, or the mean of the
aligned demonstrations, estimated in turn with the warps and kept at their average timing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from intent_recognition.alignment.fit import (
    Curves,
    WarpProblem,
    descend,
    recorded_phase,
    total_cost,
)
from intent_recognition.alignment.reference import (
    Template,
    choose_reference,
    resample,
    typical_deviation,
)
from intent_recognition.alignment.search import search
from intent_recognition.alignment.warp import MAX_LOG_RATE, Warp, slope_basis
from intent_recognition.array_types import Floats, brief
from intent_recognition.errors import ArgumentError, ShapeError


@dataclass(frozen=True)
class AlignmentSettings:
    """Prior of the warps, and settings of their fit.

    Attributes:
        rate_std: prior standard deviation of the log rate (0.2: speeds from 0.8 to 1.2 times the
            reference's are usual). Smaller values change the timing of recordings less.
        rate_correlation: correlation length of the log rate, in phase (Matern 3/2).
        end_std: prior standard deviation of the recorded phases at both ends of the reference.
        n_independent: number of samples per demonstration that count as independent evidence.
        n_basis: number of basis functions of the log rate.
        n_grid: number of even phases at which trajectories are compared.
        smoothing: width of the kernel that smooths trajectories, in phase.
        n_iterations: largest number of steps of a descent.
        n_means: number of alternations of warps and mean, for the reference "mean".

    Raises:
        ArgumentError: a setting is out of range.
    """

    rate_std: float = 0.2
    rate_correlation: float = 0.1
    end_std: float = 0.05
    n_independent: float = 30.0
    n_basis: int = 12
    n_grid: int = 61
    smoothing: float = 0.01
    n_iterations: int = 10
    n_means: int = 4

    def __post_init__(self) -> None:
        for name in ("rate_std", "rate_correlation", "end_std", "n_independent", "smoothing"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                cure = "Start from the default."
                raise ArgumentError.about(name, "a positive number", value, cure)
        for name, least in (("n_basis", 3), ("n_grid", 33), ("n_iterations", 1), ("n_means", 1)):
            value = getattr(self, name)
            if value < least:
                cure = "Start from the default."
                raise ArgumentError.about(name, f"at least {least}", value, cure)

    @property
    def basis(self) -> Floats:
        """Basis functions of the log rate between grid points, (G - 1, K)."""
        return slope_basis(self.n_basis, self.n_grid)


@brief
class Alignment(NamedTuple):
    """Warps of the demonstrations, their template, and the aligned demonstrations.

    Attributes:
        warps: one warp per demonstration.
        template: reference and scales; `align_to` aligns later demonstrations with it.
        reference_index: index of the demonstration that is the reference, None if none is.
        aligned: the smoothed demonstrations at even reference phases, (n, G, D).
    """

    warps: tuple[Warp, ...]
    template: Template
    reference_index: int | None
    aligned: Floats


def align(
    trajectories: Sequence[Floats] | Floats,
    reference: str | int | Floats = "mean",
    settings: AlignmentSettings | None = None,
) -> Alignment:
    """Align the demonstrations of one task in time.

    Each DOF is scaled by its typical deviation between aligned demonstrations, which is estimated
    too. Units therefore do not matter, and DOFs that vary least determine the timing.

    Args:
        trajectories: n arrays (T_i, D) at even recorded phases from 0 to 1, DOFs of any units; or
            one array (n, T, D).
        reference: "mean", "medoid" (the demonstration most like the others), the index of a
            demonstration, or a trajectory (T, D).
        settings: prior of the warps and settings of their fit.

    Raises:
        ShapeError: no trajectories, or trajectories that do not fit each other.
        ArgumentError: a value is not finite, or the reference is unknown.
    """
    settings = settings or AlignmentSettings()
    samples = resample(trajectories, settings.n_grid, settings.smoothing)
    values, index = choose_reference(samples, reference, settings.smoothing)
    rough = Template(values, typical_deviation(samples, samples - values))
    if isinstance(reference, str) and reference == "mean":
        template, index = _mean_template(samples, rough, settings), None
    else:
        some = samples[:: -(-len(samples) // 16)]  # at most 16 are enough for medians
        parameters = _fit(some, rough, settings, 4)  # scales need no converged warps
        deviations = _warped(some, parameters, settings) - values
        template = Template(values, typical_deviation(samples, deviations))
    parameters = _fit(samples, template, settings, settings.n_iterations)
    aligned = _warped(samples, parameters, settings)
    return Alignment(_warps(parameters, settings), template, index, aligned)


def align_to(
    template: Template,
    trajectories: Sequence[Floats] | Floats,
    settings: AlignmentSettings | None = None,
) -> tuple[Warp, ...]:
    """Warps that align demonstrations with a known template.

    Each warp is independent of the other demonstrations, and equals that of `align` when this found
    the template.

    Args:
        template: reference and scales, from `align`.
        trajectories: as in `align`.
        settings: the settings with which the template was made.

    Raises:
        ShapeError: trajectories fit neither each other nor the template.
        ArgumentError: a value is not finite.
    """
    settings = settings or AlignmentSettings()
    samples = resample(trajectories, settings.n_grid, settings.smoothing)
    if template.values.shape != samples.shape[1:]:
        expected = f"shape {samples.shape[1:]}"
        cure = "Use the settings and DOFs it was made with."
        raise ShapeError.about("template.values", expected, template.values.shape, cure)
    return _warps(_fit(samples, template, settings, settings.n_iterations), settings)


def _fit(
    samples: Floats, template: Template, settings: AlignmentSettings, n_iterations: int
) -> Floats:
    """Parameters of the warps, (n, K + 1), none of higher cost than the identity."""
    problem = _problem(samples, template, settings)
    start = search(problem, settings.rate_std, settings.rate_correlation)
    parameters, cost = descend(problem, start, n_iterations)
    identity = np.zeros_like(parameters)
    return np.where((cost < total_cost(problem, identity))[:, None], parameters, identity)


def _mean_template(samples: Floats, template: Template, settings: AlignmentSettings) -> Template:
    """Mean and scales of the aligned demonstrations, at their average timing."""
    grid = np.linspace(0.0, 1.0, settings.n_grid)
    for _ in range(settings.n_means):
        parameters = _fit(samples, template, settings, settings.n_iterations)
        aligned = _warped(samples, parameters, settings)
        mean = aligned.mean(axis=0)
        scale = typical_deviation(samples, aligned - mean)
        average = recorded_phase(settings.basis, parameters)[0].mean(axis=0)
        columns = [np.interp(grid, average, column) for column in mean.T]
        template = Template(np.stack(columns, axis=1), scale)
    return template


def _problem(samples: Floats, template: Template, settings: AlignmentSettings) -> WarpProblem:
    """Data and priors of warps onto a template, DOFs scaled."""
    return WarpProblem(
        Curves.through(samples / template.scale),
        template.values / template.scale,
        settings.basis,
        _rate_precision(settings),
        settings.end_std,
        settings.n_independent,
    )


def _warps(parameters: Floats, settings: AlignmentSettings) -> tuple[Warp, ...]:
    rates = np.clip(parameters[:, 1:] @ settings.basis.T, -MAX_LOG_RATE, MAX_LOG_RATE)
    return tuple(Warp(row[0], rate) for row, rate in zip(parameters, rates, strict=True))


def _warped(samples: Floats, parameters: Floats, settings: AlignmentSettings) -> Floats:
    """Demonstrations (n, G, D) at even reference phases."""
    return Curves.through(samples).at(recorded_phase(settings.basis, parameters)[0])[0]


@lru_cache(maxsize=16)
def _rate_precision(settings: AlignmentSettings) -> Floats:
    """Prior precision of the weights, (K, K): a Matern 3/2 process of the log rate."""
    centers = np.linspace(0.0, 1.0, settings.n_basis)
    lag = np.sqrt(3.0) * np.abs(centers[:, None] - centers) / settings.rate_correlation
    covariance = (1.0 + lag) * np.exp(-lag)
    variance = np.einsum("tk,kl,tl->t", settings.basis, covariance, settings.basis)
    return np.linalg.inv(covariance) * (np.mean(variance) / settings.rate_std**2)

# SPDX-License-Identifier: Apache-2.0
"""Normalised Gaussian basis functions of the phase (Maeda et al. 2014, Eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from intent_recognition.array_types import Floats, read_only
from intent_recognition.errors import ArgumentError, number


@dataclass(frozen=True)
class NormalizedRBFBasis:
    """N Gaussians evenly spaced over phase [0, 1], normalised to sum to one at every phase.

    Attributes:
        n_basis: number of basis functions N, at least 3.
        width: standard deviation of each Gaussian in units of the spacing between centres.

    Raises:
        ArgumentError: `n_basis` is below 3 or not a whole number, or `width` is not positive.
    """

    n_basis: int = 20
    width: float = 1.5

    def __post_init__(self) -> None:
        whole = isinstance(self.n_basis, int | np.integer)
        if not whole or self.n_basis < 3 or not number(self.width) > 0:
            expected = "3 basis functions or more, a whole number, of positive width"
            got = f"{self.n_basis} of width {self.width}"
            raise ArgumentError.about("n_basis, width", expected, got, "Try 20 of width 1.5.")

    @cached_property
    def centers(self) -> Floats:
        """Phases of the centres, (N,)."""
        return read_only(np.linspace(0.0, 1.0, self.n_basis))

    @property
    def scale(self) -> float:
        """Standard deviation of each Gaussian, in phase."""
        return self.width / (self.n_basis - 1)

    def design_matrix(self, phase: Floats) -> Floats:
        """Basis functions at phases (...,): (..., N). Phases are clipped to [0, 1]."""
        phase = np.minimum(np.maximum(phase, 0.0), 1.0)
        values = (phase[..., None] - self.centers) / self.scale
        values *= values
        values *= -0.5
        if self.width < 0.05:  # between two centres all functions would underflow
            values -= np.maximum.reduce(values, axis=-1, keepdims=True)
        np.exp(values, out=values)
        values /= np.add.reduce(values, axis=-1, keepdims=True)
        return values

    def derivative_matrix(self, phase: Floats) -> Floats:
        """d basis / d phase at phases (...,): (..., N); zero outside [0, 1].

        A velocity is this times the phase rate dz/dt, so it depends on the movement's duration.
        """
        values = self.design_matrix(phase)
        phase = np.asarray(phase, dtype=np.float64)
        slope = -(np.clip(phase, 0.0, 1.0)[..., None] - self.centers) / self.scale**2
        gradient = values * (slope - np.sum(values * slope, axis=-1, keepdims=True))
        inside = (phase >= 0.0) & (phase <= 1.0)
        return gradient * inside[..., None]

    def scaling(self, factor: Floats | float) -> Floats:
        """Matrices that scale displacements from the start by factors (...,): (..., N, N).

        Applied to weights, a position q(z) becomes q(0) + factor (q(z) - q(0)).
        """
        start = self.design_matrix(np.zeros(1))  # equal weights give a constant position
        by = np.asarray(factor, dtype=np.float64)[..., None, None]
        return np.asarray(by * np.eye(self.n_basis) + (1.0 - by) * start, dtype=np.float64)

    def shifting(self, later: Floats | float) -> Floats:
        """Matrices that delay trajectories in phase by (...,): (..., N, N).

        Applied to weights, a position q(z) becomes q(z - later), by least squares over the phase. A
        slight penalty on curvature keeps the weights of wide basis functions small.
        """
        by = np.asarray(later, dtype=np.float64)[..., None]
        if not np.any(by):
            return np.broadcast_to(np.eye(self.n_basis), (*by.shape[:-1], *2 * [self.n_basis]))
        phases = np.linspace(0.0, 1.0, 5 * self.n_basis)
        bends = 1e-3 * np.diff(np.eye(self.n_basis), 2, axis=0)
        fit = np.linalg.pinv(np.vstack([self.design_matrix(phases), bends]))[:, : len(phases)]
        return np.asarray(fit @ self.design_matrix(phases - by), dtype=np.float64)

# SPDX-License-Identifier: Apache-2.0
"""A pour in the warped space, as a probabilistic movement primitive (Brandl et al. III-B).

The warped space has four dimensions: the lip's distance from the centre of the second opening along
and across the pour, divided by that opening's radius; its height above that centre, divided by the
held container's height; and the tilt, divided by the held container's tilt reference. A primitive
learned with one pair of containers is rescaled by the values of the next pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, brief
from intent_recognition.errors import TrainingError
from intent_recognition.gaussian import Gaussian, covariance_root
from intent_recognition.promp import InteractionProMP, NormalizedRBFBasis, fit_weights
from intent_recognition.warping.parameters import References

WARPED_NAMES = ("along", "across", "up", "tilt")
N_WARPED = len(WARPED_NAMES)


def warped_scale(cup: References, second: References) -> Floats:
    """Values (4,) by which along [m], across [m], up [m] and tilt [rad] are divided."""
    radius = second.opening_radius_m
    return np.array([radius, radius, cup.height_m, cup.tilt_rad])


def to_warped(offset_m: Floats, tilt_rad: Floats, cup: References, second: References) -> Floats:
    """Convert a path of the lip to ratios (T, 4).

    `offset_m` (T, 3) is the lip's offset from the centre of the second opening along, across and
    up, `tilt_rad` (T,) the tilt of the held container.
    """
    return np.column_stack([offset_m, tilt_rad]) / warped_scale(cup, second)


def from_warped(path: Floats, cup: References, second: References) -> tuple[Floats, Floats]:
    """Convert ratios (T, 4) to offsets (T, 3) [m] and tilts (T,) [rad]; inverse of `to_warped`."""
    scaled = path * warped_scale(cup, second)
    return scaled[:, :3], scaled[:, 3]


@brief
@dataclass(frozen=True)
class WarpedPrimitive:
    """Distribution over pours in the warped space, made by `learn`.

    Attributes:
        basis: N basis functions of the phase.
        mean: mean of the weights (4 N,), grouped by DOF.
        spread: root (4 N, r) of the weights' covariance, spread @ spread.T, with one column per
            demonstration.
        duration_s: mean duration of the demonstrations.
    """

    basis: NormalizedRBFBasis
    mean: Floats
    spread: Floats
    duration_s: float

    @classmethod
    def learn(
        cls,
        paths: Sequence[Floats],
        durations_s: Sequence[float],
        basis: NormalizedRBFBasis | None = None,
    ) -> WarpedPrimitive:
        """Learn from demonstrations that begin and end together.

        Args:
            paths: path of each demonstration (T_i, 4), evenly spaced in time.
            durations_s: duration of each demonstration.
            basis: basis functions; 20 of them by default.

        Raises:
            TrainingError: there are fewer than two demonstrations, or not one duration for each.
        """
        basis = basis or NormalizedRBFBasis(20)
        if len(paths) < 2 or len(paths) != len(durations_s):
            got = (len(paths), len(durations_s))
            cure = "Record at least two."
            raise TrainingError.about("paths, durations_s", "two or more, paired", got, cure)
        weights = []
        for path in paths:
            phase = np.linspace(0.0, 1.0, len(path))
            weights.append(fit_weights(basis, phase, path).weights.ravel())
        mean = np.mean(weights, axis=0)
        spread = (np.array(weights) - mean).T / np.sqrt(len(weights) - 1.0)
        return cls(basis, mean, spread, float(np.mean(durations_s)))

    def given(self, cup: References, second: References) -> InteractionProMP:
        """The pour with these containers, a primitive in metres and radians.

        The references are the context of the primitive: the mean and the deviations of the weights
        are linear in them, with a gain that follows from the warped space and need not be learned
        from many pairs. The start and the end of the pour are free, so that they can be conditioned
        on where the cup stands (`promp.via_point`); the part above the opening is as learned.

        Returns:
            A primitive without observed DOFs; the controlled ones are along, across, up, tilt.
        """
        scale = np.repeat(warped_scale(cup, second), self.basis.n_basis)
        spread = scale[:, None] * np.column_stack([self.spread, self._free_ends()])
        weights = Gaussian(scale * self.mean, spread @ spread.T)
        noise = (1e-3 * warped_scale(cup, second)) ** 2  # about 0.1 mm, above rounding
        return InteractionProMP(self.basis, weights, 0, noise, self.duration_s)

    def _free_ends(self) -> Floats:
        """Root (4 N, 4 N) of the covariance that frees the start and the end of a pour."""
        at = self.basis.centers
        path = self.mean_path(at)
        above = at[np.hypot(path[:, 0], path[:, 1]) < 1.0]
        first, last = (above[0], above[-1]) if len(above) else (0.5, 0.5)
        share = np.maximum(first - at, 0.0) / (first or 1.0)  # none where it begins above it
        share += np.maximum(at - last, 0.0) / ((1.0 - last) or 1.0)
        apart = (at[:, None] - at) / 0.15  # smooth over this phase
        own = np.outer(share, share) * np.exp(-0.5 * apart**2)
        # as far from the opening as the demonstrations begin
        roots = np.kron(np.eye(N_WARPED), 3.0 * covariance_root(own))
        return np.asarray(roots, dtype=np.float64)

    def mean_path(self, phase: Floats) -> Floats:
        """Mean at phases (T,): (T, 4)."""
        return self._roll_out(self.mean, phase)

    def std_path(self, phase: Floats) -> Floats:
        """Standard deviation at phases (T,): (T, 4)."""
        design = self.basis.design_matrix(phase)
        parts = self.spread.reshape(N_WARPED, self.basis.n_basis, -1)
        return np.sqrt(np.sum(np.einsum("tn,dnr->tdr", design, parts) ** 2, axis=-1))

    def sample(self, phase: Floats, rng: np.random.Generator) -> Floats:
        """One pour drawn from the distribution, at phases (T,): (T, 4)."""
        drawn = self.mean + self.spread @ rng.standard_normal(self.spread.shape[1])
        return self._roll_out(drawn, phase)

    def _roll_out(self, weights: Floats, phase: Floats) -> Floats:
        return self.basis.design_matrix(phase) @ weights.reshape(N_WARPED, -1).T

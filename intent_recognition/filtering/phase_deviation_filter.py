# SPDX-License-Identifier: Apache-2.0
"""Weights and phase deviation of one task under several durations, filtered together.

Each duration is a hypothesis: a Gaussian over the observed weights and a grid of probabilities over
the phase deviation. An observation weighs the deviations by how well each explains it; the weights
are then conditioned on it once, at the expected basis functions, with the covariance that the
uncertain phase induces as additional noise (assumed-density filtering). The steps are kept, and the
deviations smoothed when asked for.
"""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.gaussian import Gaussian, log_density, symmetrize, whiten_innovation
from intent_recognition.promp import (
    AlignedPrimitives,
    deviation_prior,
    deviation_transition,
    reference_phase,
)


class PhaseDeviationFilter:
    """Filter of S hypotheses of one task.

    Args:
        primitives: the learned primitives.
        mean, covariance: prior of the observed weights, one for all hypotheses or one for each,
            (..., P N) and (..., P N, P N).
        duration_s: of the whole movement under each hypothesis, (S,).

    Attributes:
        mean, covariance: filtered observed weights, (S, P N) and (S, P N, P N).
        phase_deviation: present probability of each deviation, (S, E).
        log_evidence: of all observations, the deviation marginalised, (S,).
        elapsed_s: when the last observation was made, None before the first.
    """

    def __init__(
        self,
        primitives: AlignedPrimitives,
        mean: NDArray[np.float64],
        covariance: NDArray[np.float64],
        duration_s: NDArray[np.float64],
    ):
        n, size = len(duration_s), primitives.n_observed_weights
        self.primitives, self.duration_s = primitives, duration_s
        self.mean = np.broadcast_to(mean, (n, size)).copy()
        self.covariance = np.broadcast_to(covariance, (n, size, size)).copy()
        self.phase_deviation = np.tile(deviation_prior(primitives.phase_deviation), (n, 1))
        self.log_evidence = np.zeros(n)
        self.elapsed_s: float | None = None
        self._steps: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]] = []
        self._times: list[float] = []

    def observe(
        self,
        elapsed_s: float,
        dofs: NDArray[np.int64],
        values: NDArray[np.float64],
        noise: NDArray[np.float64],
    ) -> None:
        """Condition on positions of some observed DOFs.

        Args:
            elapsed_s: time since onset; one before the last, of another signal, is taken at its own
                time and at the present phase deviation.
            dofs: which DOFs, (m,).
            values: (m,), or one row for each hypothesis, (S, m).
            noise: covariance, (m, m).
        """
        primitives, n_basis = self.primitives, self.primitives.basis.n_basis
        n, n_deviations = self.phase_deviation.shape
        moved = np.eye(n_deviations)
        if self.elapsed_s is not None and n_deviations > 1:
            moved = deviation_transition(
                primitives.phase_deviation, (elapsed_s - self.elapsed_s) / self.duration_s
            )
            self.phase_deviation = np.einsum("se,sef->sf", self.phase_deviation, moved)
        phase = reference_phase(primitives.phase_deviation, elapsed_s / self.duration_s)
        design = primitives.basis.design_matrix(phase)  # (S, E, N)
        weights = self.mean.reshape(n, -1, n_basis)[:, dofs]
        expected = np.matmul(design, np.swapaxes(weights, 1, 2))  # (S, E, m)
        blocks = self.covariance.reshape(n, -1, n_basis, self.mean.shape[1])[:, dofs]
        self.elapsed_s = elapsed_s if self.elapsed_s is None else max(elapsed_s, self.elapsed_s)
        if n_deviations == 1:
            innovation = values - expected[:, 0]
            self.log_evidence += self._condition(design[:, 0], blocks, dofs, innovation, noise)
            return
        innovation = np.asarray(values)[..., None, :] - expected
        tempered = self._weigh_deviations(design, blocks, dofs, innovation, noise)
        row = np.einsum("se,sen->sn", self.phase_deviation, design)
        mean = np.einsum("se,sem->sm", self.phase_deviation, innovation)
        apart = innovation - mean[:, None]
        induced = np.einsum("se,sem,ser->smr", self.phase_deviation, apart, apart)
        self._condition(row, blocks, dofs, mean, induced + noise)
        moved = np.broadcast_to(moved, (n, *moved.shape[-2:]))
        self._steps.append((moved, self.phase_deviation, tempered))
        self._times.append(self.elapsed_s)

    def _weigh_deviations(
        self,
        design: NDArray[np.float64],
        blocks: NDArray[np.float64],
        dofs: NDArray[np.int64],
        innovation: NDArray[np.float64],
        noise: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Take the likelihood of each deviation into account; it is returned, tempered, (S, E)."""
        n, n_deviations, n_basis = design.shape
        cross = np.matmul(design[:, None], blocks)
        cross = cross.reshape(n, len(dofs), n_deviations, -1, n_basis)[:, :, :, dofs]
        covariance = symmetrize(np.einsum("spern,sen->sepr", cross, design) + noise)
        density = log_density(Gaussian(np.zeros(len(dofs)), covariance), innovation)
        best = density.max(axis=1, keepdims=True)
        likelihood = np.exp(density - best)
        self.log_evidence += np.log(np.sum(self.phase_deviation * likelihood, axis=1)) + best[:, 0]
        tempered = np.exp(self.primitives.phase_deviation.evidence * (density - best))
        weighed = self.phase_deviation * tempered
        self.phase_deviation = weighed / weighed.sum(axis=1, keepdims=True)
        return tempered

    def _condition(
        self,
        row: NDArray[np.float64],
        blocks: NDArray[np.float64],
        dofs: NDArray[np.int64],
        innovation: NDArray[np.float64],
        noise: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Condition the weights at one row of basis functions (S, N): log densities, (S,)."""
        n, n_basis = row.shape
        cross = np.matmul(row[:, None, None], blocks)[:, :, 0]  # H P, (S, m, P N)
        own = cross.reshape(n, len(dofs), -1, n_basis)[:, :, dofs]
        own = np.matmul(own, row[:, None, :, None])[..., 0]  # H P H^T
        cross, innovation, density = whiten_innovation(symmetrize(own + noise), cross, innovation)
        gain = np.swapaxes(cross, 1, 2)
        self.mean += np.matmul(gain, innovation[..., None])[..., 0]
        self.covariance -= np.matmul(gain, cross)
        return density

    def deviations_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Probability of each deviation at times after onset given all observations, (S, T, E)."""
        if self.phase_deviation.shape[1] == 1:
            return np.ones((len(self.duration_s), len(times_s), 1))
        if not self._steps:
            prior = deviation_prior(self.primitives.phase_deviation)
            return np.tile(prior, (len(self.duration_s), len(times_s), 1))
        smoothed, seen_s = self._smoothed(), np.array(self._times)
        after = np.clip(np.searchsorted(seen_s, times_s), 0, len(seen_s) - 1)
        before = np.maximum(after - 1, 0)
        gap = np.maximum(seen_s[after] - seen_s[before], 1e-9)
        share = np.clip((times_s - seen_s[before]) / gap, 0.0, 1.0)[:, None]
        phase_deviation = (1.0 - share) * smoothed[:, before] + share * smoothed[:, after]
        future = times_s > seen_s[-1]
        passed = (times_s[future] - seen_s[-1]) / self.duration_s[:, None]
        phase_deviation[:, future] = np.einsum(
            "se,stef->stf",
            self.phase_deviation,
            deviation_transition(self.primitives.phase_deviation, passed),
        )
        return phase_deviation

    def _smoothed(self) -> NDArray[np.float64]:
        """Deviations at the observations given all of them, (S, n, E): the backward recursion."""
        later = np.ones_like(self.phase_deviation)
        smoothed = []
        for moved, phase_deviation, likelihood in reversed(self._steps):
            now = phase_deviation * later
            smoothed.append(now / now.sum(axis=1, keepdims=True))
            later = np.einsum("sef,sf->se", moved, later * likelihood)
            later /= later.max(axis=1, keepdims=True)
        return np.stack(smoothed[::-1], axis=1)

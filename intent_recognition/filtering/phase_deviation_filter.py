# SPDX-License-Identifier: Apache-2.0
"""Weights and lead of one task under several durations, filtered together.

Each duration is a hypothesis: a Gaussian over the observed weights and a grid of probabilities over
the lead. An observation weighs the leads by how well each explains it; the weights are then
conditioned on it once, at the expected basis functions, with the doubt about the lead as additional
noise (assumed-density filtering). The leads are kept from step to step and smoothed when asked for.
"""

import numpy as np

from intent_recognition.gaussian import cholesky, log_normalizer, solve_lower, symmetrize
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
        lead: probability of each lead by now, (S, E).
        log_evidence: of all observations, lead marginalised, (S,).
        elapsed_s: when the last observation was made, None before the first.
    """

    def __init__(
        self,
        primitives: AlignedPrimitives,
        mean: np.ndarray,
        covariance: np.ndarray,
        duration_s: np.ndarray,
    ):
        n, size = len(duration_s), primitives.n_observed_weights
        self.primitives, self.duration_s = primitives, duration_s
        self.mean = np.broadcast_to(mean, (n, size)).copy()
        self.covariance = np.broadcast_to(covariance, (n, size, size)).copy()
        self.phase_deviation = np.tile(deviation_prior(primitives.phase_deviation), (n, 1))
        self.log_evidence = np.zeros(n)
        self.elapsed_s: float | None = None
        self._steps: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._times: list[float] = []

    def observe(
        self, elapsed_s: float, dofs: np.ndarray, values: np.ndarray, noise: np.ndarray
    ) -> None:
        """Take positions of some observed DOFs.

        Args:
            elapsed_s: time since onset; one before the last, of another signal, is taken at its own
                time and at the lead by now.
            dofs: which DOFs, (m,).
            values: (m,), or one for each hypothesis, (S, m).
            noise: covariance, (m, m).
        """
        primitives, n, m = self.primitives, len(self.duration_s), len(dofs)
        n_basis = primitives.basis.n_basis
        n_leads = self.phase_deviation.shape[1]
        moved = np.eye(n_leads)
        if self.elapsed_s is not None and n_leads > 1:
            moved = deviation_transition(
                primitives.phase_deviation, (elapsed_s - self.elapsed_s) / self.duration_s
            )
            self.phase_deviation = np.einsum("se,sef->sf", self.phase_deviation, moved)
        phase = reference_phase(primitives.phase_deviation, elapsed_s / self.duration_s)
        design = primitives.basis.design_matrix(phase)  # (S, E, N)
        blocks = self.covariance.reshape(n, -1, n_basis, self.mean.shape[1])[:, dofs]
        now_s = elapsed_s if self.elapsed_s is None else max(elapsed_s, self.elapsed_s)
        if n_leads == 1:
            self._observe_steady(design[:, 0], blocks, dofs, np.asarray(values), noise)
            self.elapsed_s = now_s
            return
        weights = self.mean.reshape(n, -1, n_basis)[:, dofs]
        expected = np.matmul(design, np.swapaxes(weights, 1, 2))  # (S, E, m)
        half = np.matmul(design[:, None], blocks).reshape(n, m, phase.shape[1], -1, n_basis)
        spread = np.einsum("spern,sen->sepr", half[:, :, :, dofs], design)
        factor = cholesky(symmetrize(spread + noise), name="innovation covariance")
        innovation = np.asarray(values)[..., None, :] - expected
        whitened = solve_lower(factor, innovation[..., None])[..., 0]
        density = -0.5 * np.sum(whitened**2, axis=-1) - log_normalizer(factor)
        best = density.max(axis=1, keepdims=True)
        likelihood = np.exp(density - best)
        self.log_evidence += np.log(np.sum(self.phase_deviation * likelihood, axis=1)) + best[:, 0]
        tempered = np.exp(primitives.phase_deviation.evidence * (density - best))
        phase_deviation = self.phase_deviation * tempered
        self.phase_deviation = phase_deviation / phase_deviation.sum(axis=1, keepdims=True)
        self._condition(design, blocks, expected, dofs, np.asarray(values), noise)
        self._steps.append(
            (np.broadcast_to(moved, (n, *moved.shape[-2:])), self.phase_deviation, tempered)
        )
        self.elapsed_s = now_s
        self._times.append(now_s)

    def _observe_steady(
        self,
        row: np.ndarray,
        blocks: np.ndarray,
        dofs: np.ndarray,
        values: np.ndarray,
        noise: np.ndarray,
    ) -> None:
        """Take values with a single lead, in half the time: plain conditioning."""
        n, n_basis = row.shape
        weights = self.mean.reshape(n, -1, n_basis)[:, dofs]
        cross = np.matmul(row[:, None, None], blocks)[:, :, 0]  # H S, (S, m, P N)
        own = np.matmul(cross.reshape(n, len(dofs), -1, n_basis)[:, :, dofs], row[:, None, :, None])
        factor = cholesky(symmetrize(own[..., 0] + noise), name="innovation covariance")
        innovation = values - np.matmul(weights, row[..., None])[..., 0]
        scaled = solve_lower(factor, np.concatenate([cross, innovation[..., None]], axis=2))
        scaled, whitened = scaled[..., :-1], scaled[..., -1]
        self.log_evidence -= 0.5 * np.sum(whitened**2, axis=-1) + log_normalizer(factor)
        turned = np.swapaxes(scaled, 1, 2)
        self.mean += np.matmul(turned, whitened[..., None])[..., 0]
        self.covariance -= np.matmul(turned, scaled)

    def _condition(
        self,
        design: np.ndarray,
        blocks: np.ndarray,
        expected: np.ndarray,
        dofs: np.ndarray,
        values: np.ndarray,
        noise: np.ndarray,
    ) -> None:
        """Condition the weights on values seen at an uncertain lead."""
        n, m, n_basis = len(design), len(dofs), design.shape[2]
        row = np.einsum("se,sen->sn", self.phase_deviation, design)
        mean = np.einsum("se,sem->sm", self.phase_deviation, expected)
        deviation = expected - mean[:, None]
        doubt = np.einsum("se,sem,ser->smr", self.phase_deviation, deviation, deviation)
        cross = np.matmul(row[:, None, None], blocks)[:, :, 0]  # H S, (S, m, P N)
        own = np.einsum("smrn,sn->smr", cross.reshape(n, m, -1, n_basis)[:, :, dofs], row)
        factor = cholesky(symmetrize(own + doubt + noise), name="innovation covariance")
        scaled = solve_lower(factor, cross)
        whitened = solve_lower(factor, (values - mean)[..., None])
        self.mean += np.matmul(np.swapaxes(scaled, 1, 2), whitened)[..., 0]
        self.covariance -= np.matmul(np.swapaxes(scaled, 1, 2), scaled)

    def deviations_at(self, times_s: np.ndarray) -> np.ndarray:
        """Probability of each lead at times after onset given all observations, (S, T, E)."""
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

    def _smoothed(self) -> np.ndarray:
        """Leads at the observations given all of them, (S, n, E): the backward recursion."""
        later = np.ones_like(self.phase_deviation)
        smoothed = []
        for moved, phase_deviation, likelihood in reversed(self._steps):
            now = phase_deviation * later
            smoothed.append(now / now.sum(axis=1, keepdims=True))
            later = np.einsum("sef,sf->se", moved, later * likelihood)
            later /= later.max(axis=1, keepdims=True)
        return np.stack(smoothed[::-1], axis=1)

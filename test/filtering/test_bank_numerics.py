# SPDX-License-Identifier: Apache-2.0
"""The bank in place against joint Gaussians, with all that observations may be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import bank_of
from scipy.stats import multivariate_normal
from simulation import START_NS, draw_weights, make_library

from intent_recognition.filtering import MovementFilter, PriorGrid, make_prior_grid, task_posterior
from intent_recognition.filtering.observation_model import SPACING
from intent_recognition.signals.observation import Observation

seeds = st.integers(0, 2**32 - 1)


def stream(library, rng: np.random.Generator, n: int = 60, noise_std: float = 0.003):
    """Irregular stamps; of either signal a random subset of DOFs, positions or velocities."""
    duration_s = 2.0
    weights = draw_weights(library, 0, rng)[: library.n_observed]
    observations = []
    for elapsed_s in np.sort(rng.uniform(0.0, duration_s, size=n)):
        group = int(rng.integers(len(library.observed_groups)))
        size = library.observed_groups[group]
        dofs = tuple(int(d) for d in rng.permutation(size)[: rng.integers(1, size + 1)])
        first = sum(library.observed_groups[:group])
        derivative = bool(rng.uniform() < 0.3)
        phase = np.array([elapsed_s / duration_s])
        row = library.basis.design_matrix(phase)
        if derivative:
            row = library.basis.derivative_matrix(phase) / duration_s
        values = (row @ weights.T)[0, [first + d for d in dofs]]
        root = rng.normal(size=(len(dofs), len(dofs))) * noise_std
        covariance = root @ root.T + noise_std**2 * np.eye(len(dofs))
        values = values + rng.multivariate_normal(np.zeros(len(dofs)), covariance)
        stamp_ns = START_NS + round(elapsed_s * 1e9)
        given = covariance if derivative or rng.uniform() < 0.5 else None
        observations.append(Observation(stamp_ns, group, values, given, dofs, derivative))
    return observations


def joint(library, hypotheses: PriorGrid, observations, hypothesis: int):
    """Mean, covariance and log evidence from one Gaussian over weights and all observations."""
    n_basis = library.basis.n_basis
    matrices, values, noises = [], [], []
    last_ns, used_ns = {}, {}
    for o in observations:
        kind = o.group, o.dofs, o.derivative
        if o.stamp_ns - used_ns.get(kind, 0) < SPACING * library.correlation_time_s * 1e9:
            continue
        used_ns[kind] = o.stamp_ns
        elapsed_s = (o.stamp_ns - START_NS) * 1e-9
        duration_s = hypotheses.duration_s[hypothesis]
        phase = np.array([elapsed_s / duration_s])
        row = library.basis.design_matrix(phase)[0]
        if o.derivative:
            row = library.basis.derivative_matrix(phase)[0] / duration_s
        dofs = np.array([sum(library.observed_groups[: o.group]) + d for d in o.dofs])
        matrix = np.zeros((len(dofs), library.n_observed * n_basis))
        for i, dof in enumerate(dofs):
            matrix[i, dof * n_basis : (dof + 1) * n_basis] = row
        noise = np.zeros((len(dofs), len(dofs))) if o.covariance is None else o.covariance
        if not o.derivative:
            since = [o.stamp_ns - last_ns[d] for d in dofs if d in last_ns]
            interval_s = min(since) * 1e-9 if since else np.inf
            noise = noise + library.noise_covariance(dofs, interval_s)
            last_ns |= dict.fromkeys(dofs, o.stamp_ns)
        matrices.append(matrix)
        values.append(o.values)
        noises.append(noise)
    H, y = np.vstack(matrices), np.concatenate(values)
    R = np.zeros((len(y), len(y)))
    at = 0
    for noise in noises:
        R[at : at + len(noise), at : at + len(noise)] = noise
        at += len(noise)
    task = hypothesis // hypotheses.n_scales
    mean, covariance = library.observed_mean[task], library.observed_covariance[task]
    S = H @ covariance @ H.T + R
    gain = np.linalg.solve(S, H @ covariance).T
    return (
        mean + gain @ (y - H @ mean),
        covariance - gain @ H @ covariance,
        multivariate_normal(H @ mean, S).logpdf(y),
    )


@settings(max_examples=8)
@given(seeds)
def test_any_observations_in_any_order_of_signals_equal_one_joint_gaussian(seed):
    rng = np.random.default_rng(seed)
    library = make_library(rng, groups=(3, 2), n_basis=20, correlation_time_s=0.03)
    hypotheses = make_prior_grid(library, n_scales=3)
    observations = stream(library, rng)
    run = MovementFilter(library, hypotheses, START_NS)
    for observation in observations:
        run.observe(observation)
        total = task_posterior(run.log_evidence, hypotheses, 0.0).probabilities.sum()
        assert total == pytest.approx(1.0, abs=1e-12)
    bank = bank_of(run)
    for b in (0, 4, 11):
        mean, covariance, log_evidence = joint(library, hypotheses, observations, b)
        assert np.abs(bank.mean[b] - mean).max() <= 1e-9 * np.abs(mean).max()
        prior = library.observed_covariance[b // 3]
        assert np.abs(bank.covariance[b] - covariance).max() <= 1e-9 * np.abs(prior).max()
        assert bank.log_evidence[b] == pytest.approx(log_evidence, rel=1e-8, abs=1e-8)

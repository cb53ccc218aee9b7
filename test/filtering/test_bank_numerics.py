# SPDX-License-Identifier: Apache-2.0
"""The bank in place against joint Gaussians, with all that observations may be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from simulation import START_NS, draw_weights, make_library

from intent_recognition.errors import ArgumentError
from intent_recognition.filtering.hypotheses import Hypotheses, make_hypotheses
from intent_recognition.filtering.movement import MovementFilter
from intent_recognition.filtering.observation_model import SPACING
from intent_recognition.gaussian import batch as filter_block
from intent_recognition.gaussian.batch import GaussianBatch, make_state
from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.recognition.posterior import task_posterior
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


def joint(library, hypotheses: Hypotheses, observations, hypothesis: int):
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
    hypotheses = make_hypotheses(library, n_scales=3)
    observations = stream(library, rng)
    run = MovementFilter(library, hypotheses, START_NS)
    for observation in observations:
        run.observe(observation)
        total = task_posterior(run.log_evidence, hypotheses, 0.0).probabilities.sum()
        assert total == pytest.approx(1.0, abs=1e-12)
    bank = run.bank
    for b in (0, 4, 11):
        mean, covariance, log_evidence = joint(library, hypotheses, observations, b)
        assert np.abs(bank.mean[b] - mean).max() <= 1e-9 * np.abs(mean).max()
        prior = library.observed_covariance[b // 3]
        assert np.abs(bank.covariance[b] - covariance).max() <= 1e-9 * np.abs(prior).max()
        assert bank.log_evidence[b] == pytest.approx(log_evidence, rel=1e-8, abs=1e-8)


def random_block(rng: np.random.Generator, n: int = 5, n_dofs: int = 3, n_basis: int = 20):
    size = n_dofs * n_basis
    root = rng.normal(size=(n, size, size)) / np.sqrt(size)
    covariance = root @ np.swapaxes(root, 1, 2) + 0.05 * np.eye(size)
    state = make_state(rng.normal(size=(n, size)), covariance, n_basis)
    return GaussianBatch(state, n_basis)


def steps(rng: np.random.Generator, n: int = 5, n_basis: int = 20, count: int = 30):
    """Rows for all DOFs alike, or one for each value; sometimes more values than memory rows."""
    for k in range(count):
        m = 30 if k == 17 else int(rng.integers(1, 5))
        dofs = rng.integers(0, 3, size=m)
        rows = rng.normal(size=(n, 1 if k % 3 else m, n_basis))
        root = rng.normal(size=(m, m))
        yield dofs, rows, rng.normal(size=m), root @ root.T + 0.1 * np.eye(m)


@given(seeds, st.sampled_from([1, 4, 9, 1000]))
@settings(max_examples=15)
def test_it_does_not_matter_when_pending_rows_are_subtracted(seed, pending_rows):
    rng = np.random.default_rng(seed)
    work = list(steps(rng))
    one = random_block(np.random.default_rng(seed))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filter_block, "PENDING_ROWS", pending_rows)
        other = random_block(np.random.default_rng(seed))
    for k, step in enumerate(work):
        a, b = one.condition(*step), other.condition(*step)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
        if k % 5 == 0:
            one.apply_downdates()
    for a, b in zip(one.current(np.arange(5)), other.current(np.arange(5)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_looking_at_the_current_distributions_changes_nothing(rng):
    looked, left = random_block(np.random.default_rng(1)), random_block(np.random.default_rng(1))
    for step in steps(rng):
        looked.condition(*step)
        left.condition(*step)
        mean, covariance = looked.current(np.array([3, 1]))
    left.apply_downdates()
    assert np.array_equal(looked.current(np.arange(5))[1], left.covariance)
    assert np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
    np.testing.assert_allclose(mean, left.mean[[3, 1]], rtol=1e-12, atol=1e-12)


def test_each_hypothesis_may_have_its_own_noise(rng):
    block = random_block(np.random.default_rng(2))
    alone = [random_block(np.random.default_rng(2)) for _ in range(5)]
    for dofs, rows, values, noise in steps(rng):
        noises = noise * np.array([1.0, 0.1, 10.0, 2.0, 0.5])[:, None, None]
        density = block.condition(dofs, rows, values, noises)
        for b, single in enumerate(alone):
            expected = single.condition(dofs, rows, values, noises[b])[b]
            assert density[b] == pytest.approx(expected, rel=1e-12)
    for b, single in enumerate(alone):
        index = np.array([b])
        np.testing.assert_allclose(block.current(index)[1], single.current(index)[1], atol=1e-12)


def test_a_refused_observation_leaves_everything_as_it_was(rng):
    refused, spared = random_block(np.random.default_rng(3)), random_block(np.random.default_rng(3))
    for k, step in enumerate(steps(rng)):
        if k % 4 == 1:
            for bad in (np.nan, -1e6):
                with pytest.raises(ArgumentError, match="innovation covariance"):
                    refused.condition(*step[:3], bad * np.eye(len(step[0])))
        density = refused.condition(*step)
        np.testing.assert_allclose(density, spared.condition(*step), rtol=1e-12)


@pytest.mark.parametrize("resting", [False, True])
def test_ten_thousand_nearly_noiseless_updates_keep_a_covariance(resting):
    """The million is a benchmark."""
    rng = np.random.default_rng(4)
    library = make_library(rng, n_basis=20)
    prior = library.observed_covariance[:2]
    block = GaussianBatch(make_state(np.zeros((2, 60)), prior, 20), 20)
    gram = np.zeros((20, 20))
    noise = 1e-8 * np.eye(3)
    for k in range(10_000):
        phase = np.full(2, 0.37) if resting else rng.uniform(size=2)
        row = library.basis.design_matrix(phase)
        gram += np.outer(row[0], row[0])
        block.condition(np.arange(3), row[:, None], np.zeros(3), noise)
        if k % 500 == 499:
            covariance = block.current(np.arange(2))[1]
            assert np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
            assert np.linalg.eigvalsh(covariance).min() > 0.0
    if resting:  # as good as one observation with a ten-thousandth of the noise
        matrix = np.kron(np.eye(3), row[:1])
        nothing = Gaussian(np.zeros(60), prior[0])
        expected = condition(nothing, matrix, np.zeros(3), noise / 10_000)[0].covariance
    else:
        information = np.linalg.inv(prior[0]) + np.kron(np.eye(3), gram) / 1e-8
        expected = np.linalg.inv(information)
    error = np.abs(covariance[0] - expected).max()
    assert error <= 1e-9 * np.abs(prior[0]).max()

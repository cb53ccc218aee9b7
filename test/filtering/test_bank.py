# SPDX-License-Identifier: Apache-2.0
"""The recursive bank against one big joint Gaussian and a full-state Kalman filter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import Bank, condition_bank, start_bank
from scipy.stats import multivariate_normal, t
from simulation import make_library

from intent_recognition.errors import ShapeError
from intent_recognition.filtering.grid import (
    DURATION_FREEDOM,
    fixed_prior_grid,
    make_prior_grid,
)
from intent_recognition.promp.basis import NormalizedRBFBasis

BASIS = NormalizedRBFBasis(6, 1.0)
N_DOFS = 3
seeds = st.integers(0, 2**32 - 1)


def random_bank(rng: np.random.Generator, n_hypotheses: int = 4) -> Bank:
    d = N_DOFS * BASIS.n_basis
    root = rng.normal(size=(n_hypotheses, d, d)) / np.sqrt(d)
    covariance = root @ np.swapaxes(root, 1, 2) + 0.05 * np.eye(d)
    return Bank(rng.normal(size=(n_hypotheses, d)), covariance, np.zeros(n_hypotheses))


def random_stream(rng: np.random.Generator, n_hypotheses: int = 4, n_steps: int = 8):
    """Steps (dofs, rows, values, noise): subsets, positions and velocities, a phase each."""
    steps = []
    for _ in range(n_steps):
        m = rng.integers(1, 5)
        dofs = rng.integers(0, N_DOFS, size=m)  # a DOF may come twice, any order
        phase = rng.uniform(size=n_hypotheses)
        rate = rng.uniform(0.2, 2.0, size=n_hypotheses)
        rows = BASIS.design_matrix(phase)[:, None]
        if rng.uniform() < 0.4:
            rows = BASIS.derivative_matrix(phase)[:, None] * rate[:, None, None]
        root = rng.normal(size=(m, m))
        steps.append((dofs, rows, rng.normal(size=m), root @ root.T + 0.1 * np.eye(m)))
    return steps


def run(bank: Bank, steps) -> Bank:
    for step in steps:
        bank = condition_bank(bank, *step)
    return bank


def dense(step, hypothesis: int) -> np.ndarray:
    """Observation matrix (m, P N) of a step under one hypothesis."""
    dofs, rows, _, _ = step
    return np.kron(np.eye(N_DOFS)[dofs], rows[hypothesis])


def batch(bank: Bank, steps, hypothesis: int):
    """Mean, covariance and log evidence from one joint Gaussian over weights and observations."""
    H = np.vstack([dense(step, hypothesis) for step in steps])
    y = np.concatenate([values for _, _, values, _ in steps])
    R = np.zeros((len(y), len(y)))
    at = 0
    for *_, noise in steps:
        R[at : at + len(noise), at : at + len(noise)] = noise
        at += len(noise)
    mean, covariance = bank.mean[hypothesis], bank.covariance[hypothesis]
    S = H @ covariance @ H.T + R
    gain = np.linalg.solve(S, H @ covariance).T
    return (
        mean + gain @ (y - H @ mean),
        covariance - gain @ H @ covariance,
        multivariate_normal(H @ mean, S).logpdf(y),
    )


@settings(max_examples=40)
@given(seeds)
def test_recursion_equals_one_joint_gaussian(seed):
    rng = np.random.default_rng(seed)
    bank, steps = random_bank(rng), random_stream(rng)
    filtered = run(bank, steps)
    for b in range(4):
        mean, covariance, log_evidence = batch(bank, steps, b)
        np.testing.assert_allclose(filtered.mean[b], mean, atol=1e-9)
        np.testing.assert_allclose(filtered.covariance[b], covariance, atol=1e-9)
        assert filtered.log_evidence[b] == pytest.approx(log_evidence, rel=1e-8, abs=1e-8)


@settings(max_examples=20)
@given(seeds)
def test_posterior_never_wider_exactly_symmetric_and_positive_definite(seed):
    rng = np.random.default_rng(seed)
    bank = random_bank(rng)
    for step in random_stream(rng):
        after = condition_bank(bank, *step)
        assert np.array_equal(after.covariance, np.swapaxes(after.covariance, 1, 2))
        assert np.linalg.eigvalsh(after.covariance).min() > 0.0
        assert np.linalg.eigvalsh(bank.covariance - after.covariance).min() > -1e-10
        bank = after


def test_observed_block_and_regression_equal_a_full_state_kalman_filter(rng):
    """The reduction of Maeda et al. 2014 to P N states loses nothing of the (P + Q) N."""
    library = make_library(rng, n_tasks=2, groups=(2,), n_controlled=2, n_basis=8)
    hypotheses = fixed_prior_grid(library, 2.0)
    bank = start_bank(library, hypotheses)
    split, total = library.n_observed_weights, library.weight_mean.shape[1]
    mean, covariance = library.weight_mean.copy(), library.weight_covariance.copy()
    noise = np.diag(library.noise_variance[:2])
    for phase in np.sort(rng.uniform(size=12)):
        row = library.basis.design_matrix(np.array([phase]))
        y = rng.normal(size=2) * 0.1
        H = np.zeros((2, total))
        H[0, :8] = H[1, 8:16] = row[0]
        for task in range(2):
            P = covariance[task]
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + noise)
            mean[task] += K @ (y - H @ mean[task])
            # The Joseph form, another algebra than the one under test.
            left = np.eye(total) - K @ H
            covariance[task] = left @ P @ left.T + K @ noise @ K.T
        bank = condition_bank(bank, np.arange(2), row[None], y, noise)
    for task in range(2):
        matrix, offset, rest = library.regressions[task]
        np.testing.assert_allclose(bank.mean[task], mean[task, :split], atol=1e-8)
        np.testing.assert_allclose(
            bank.covariance[task], covariance[task, :split, :split], atol=1e-8
        )
        recovered = matrix @ bank.mean[task] + offset
        np.testing.assert_allclose(recovered, mean[task, split:], atol=1e-8)
        spread = rest + matrix @ bank.covariance[task] @ matrix.T
        np.testing.assert_allclose(spread, covariance[task, split:, split:], atol=1e-8)


def test_many_updates_at_low_noise_equal_the_batch(rng):
    """600 observations with noise variance 1e-8 against the information form."""
    bank = random_bank(rng, 1)
    information = np.linalg.inv(bank.covariance[0])
    shift = information @ bank.mean[0]
    truth = rng.normal(size=(N_DOFS, BASIS.n_basis))
    start = bank
    for _ in range(600):
        row = BASIS.design_matrix(rng.uniform(size=1))
        y = truth @ row[0] + 1e-4 * rng.normal(size=N_DOFS)
        H = np.kron(np.eye(N_DOFS), row)
        information += 1e8 * H.T @ H
        shift += 1e8 * H.T @ y
        bank = condition_bank(bank, np.arange(N_DOFS), row[None], y, 1e-8 * np.eye(N_DOFS))
    np.testing.assert_allclose(bank.mean[0], np.linalg.solve(information, shift), atol=1e-6)
    expected = np.linalg.inv(information)
    np.testing.assert_allclose(bank.covariance[0], expected, atol=1e-6 * start.covariance.max())
    assert np.linalg.eigvalsh(bank.covariance[0]).min() > 0.0


def test_independent_dofs_do_not_move_each_other(rng):
    bank = random_bank(rng, 1)
    n = BASIS.n_basis
    covariance = bank.covariance.copy()
    covariance[:, :n, n:] = covariance[:, n:, :n] = 0.0
    bank = bank._replace(covariance=covariance)
    row = BASIS.design_matrix(np.array([0.3]))[None]
    after = condition_bank(bank, np.array([0]), row, np.ones(1), np.eye(1))
    assert np.array_equal(after.mean[:, n:], bank.mean[:, n:])
    assert np.array_equal(after.covariance[:, n:, n:], bank.covariance[:, n:, n:])


@pytest.mark.parametrize(
    ("values", "noise"), [(np.zeros(3), np.eye(2)), (np.zeros(2), np.eye(3)), (0.0, np.eye(2))]
)
def test_shapes_that_do_not_fit_are_named(rng, values, noise):
    row = BASIS.design_matrix(np.zeros(4))[:, None]
    with pytest.raises(ShapeError, match=r"values, noise_covariance: expected shapes \(2,\).*Pass"):
        condition_bank(random_bank(rng), np.arange(2), row, values, noise)


@given(seeds, st.integers(1, 20))
@settings(max_examples=10)
def test_grid_of_durations_covers_the_timing_prior(seed, n_scales):
    library = make_library(np.random.default_rng(seed), n_basis=4)
    hypotheses = make_prior_grid(library, n_scales=n_scales)
    logs = np.log(hypotheses.duration_s).reshape(-1, n_scales)
    weight = np.exp(hypotheses.log_prior).reshape(-1, n_scales)
    assert np.exp(hypotheses.log_prior).sum() == pytest.approx(1.0, abs=1e-12)
    prior = np.r_[library.task_prior * (1 - library.none_prior), library.none_prior]
    np.testing.assert_allclose(weight.sum(axis=1), prior, atol=1e-12)
    spread = library.log_duration_mean[0], library.log_duration_std[0]
    density = t(DURATION_FREEDOM, *spread).pdf(logs[0])
    np.testing.assert_allclose(weight[0] / weight[0].sum(), density / density.sum(), atol=1e-12)
    mean = (weight * logs).sum(axis=1) / prior
    np.testing.assert_allclose(mean[:-1], library.log_duration_mean, atol=1e-12)
    np.testing.assert_allclose(np.exp(hypotheses.log_task_prior), prior, atol=1e-12)


def test_an_excluded_task_keeps_probability_zero(rng):
    library = make_library(rng, n_basis=4)
    with np.errstate(all="raise"):
        hypotheses = make_prior_grid(library, np.array([0.0, 0.5, 0.5]))
    assert np.all(np.isneginf(hypotheses.log_prior[: hypotheses.n_scales]))

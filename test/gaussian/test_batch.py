# SPDX-License-Identifier: Apache-2.0
"""Gaussians conditioned in place against plain conditioning, whatever the numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_t
from simulation import make_library

from intent_recognition.errors import ArgumentError
from intent_recognition.gaussian import batch as batch_module
from intent_recognition.gaussian.batch import GaussianBatch, make_state
from intent_recognition.gaussian.normal import Gaussian, condition

seeds = st.integers(0, 2**32 - 1)


def random_batch(rng: np.random.Generator, n: int = 5, n_dofs: int = 3, n_basis: int = 20):
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
    one = random_batch(np.random.default_rng(seed))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch_module, "PENDING_ROWS", pending_rows)
        other = random_batch(np.random.default_rng(seed))
    for k, step in enumerate(work):
        a, b = one.condition(*step), other.condition(*step)
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
        if k % 5 == 0:
            one.apply_downdates()
    for a, b in zip(one.current(np.arange(5)), other.current(np.arange(5)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)


def test_downdates_may_be_applied_a_part_at_a_time():
    """Also where an observation comes before all parts are."""
    parts, whole = random_batch(np.random.default_rng(3)), random_batch(np.random.default_rng(3))
    found = []
    for k, step in enumerate(steps(np.random.default_rng(4))):
        np.testing.assert_allclose(parts.condition(*step), whole.condition(*step), rtol=1e-12)
        found += [parts.catch_up() for _ in range(k % 4)]
    assert any(found)
    assert not all(found)
    for a, b in zip(parts.current(np.arange(5)), whole.current(np.arange(5)), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


def test_looking_at_the_current_distributions_changes_nothing(rng):
    looked, left = random_batch(np.random.default_rng(1)), random_batch(np.random.default_rng(1))
    for step in steps(rng):
        looked.condition(*step)
        left.condition(*step)
        mean, covariance = looked.current(np.array([3, 1]))
    left.apply_downdates()
    assert np.array_equal(looked.current(np.arange(5))[1], left.covariance)
    assert np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
    np.testing.assert_allclose(mean, left.mean[[3, 1]], rtol=1e-12, atol=1e-12)


def test_each_hypothesis_may_have_its_own_noise(rng):
    block = random_batch(np.random.default_rng(2))
    alone = [random_batch(np.random.default_rng(2)) for _ in range(5)]
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
    refused, spared = random_batch(np.random.default_rng(3)), random_batch(np.random.default_rng(3))
    for k, step in enumerate(steps(rng)):
        if k % 4 == 1:
            for bad in (np.nan, -1e6):
                with pytest.raises(ArgumentError, match="innovation covariance"):
                    refused.condition(*step[:3], bad * np.eye(len(step[0])))
        density = refused.condition(*step)
        np.testing.assert_allclose(density, spared.condition(*step), rtol=1e-12)


@pytest.mark.slow
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


@settings(max_examples=15)
@given(seeds)
def test_what_is_predicted_is_that_of_the_distributions_in_force(seed):
    """With rows pending and without; looking changes nothing."""
    rng = np.random.default_rng(seed)
    looked, left = (random_batch(np.random.default_rng(seed)) for _ in range(2))
    for k, step in enumerate(steps(rng, count=6)):
        looked.condition(*step)
        left.condition(*step)
        if k == 3:
            looked.apply_downdates()
            left.apply_downdates()
        dofs, row = rng.permutation(3)[: rng.integers(1, 4)], rng.normal(size=(5, 20))
        mean, covariance = looked.predicted(dofs, row)
        current = looked.current(np.arange(5))
        for b in range(5):
            H = np.kron(np.eye(3)[dofs], row[b])
            np.testing.assert_allclose(covariance[b], H @ current[1][b] @ H.T, atol=1e-9)
            expected = current[0][b].reshape(3, 20)[dofs]
            np.testing.assert_allclose(mean[b], expected, rtol=1e-9, atol=1e-9)
    for a, b in zip(looked.current(np.arange(5)), left.current(np.arange(5)), strict=True):
        assert np.array_equal(a, b)


def test_each_may_have_its_own_values_and_a_student_density_conditions_alike(rng):
    prior = random_batch(np.random.default_rng(6)).current(np.arange(5))
    batch, normal = (random_batch(np.random.default_rng(6)) for _ in range(2))
    dofs, rows, _, noise = next(steps(rng))
    values = rng.normal(size=(5, len(dofs)))
    density = batch.condition(dofs, rows, values, noise, 4.0)
    normal.condition(dofs, rows, values, noise)
    mean, covariance = batch.current(np.arange(5))
    assert np.array_equal(mean, normal.current(np.arange(5))[0])
    for b in range(5):
        H = np.zeros((len(dofs), 60))
        for i, dof in enumerate(dofs):
            H[i, dof * 20 : (dof + 1) * 20] = rows[b, min(i, rows.shape[1] - 1)]
        before = Gaussian(prior[0][b], prior[1][b])
        expected, _ = condition(before, H, values[b], noise)
        np.testing.assert_allclose(mean[b], expected.mean, atol=1e-9)
        np.testing.assert_allclose(covariance[b], expected.covariance, atol=1e-9)
        spread = H @ before.covariance @ H.T + noise
        found = multivariate_t(H @ before.mean, spread, df=4.0).logpdf(values[b])
        assert density[b] == pytest.approx(found, rel=1e-9)

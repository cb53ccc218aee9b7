# SPDX-License-Identifier: Apache-2.0
"""Gaussians conditioned in place against plain conditioning and numpy's, whatever the numbers."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import batch as batch_module
from intent_recognition.gaussian.batch import KERNEL, GaussianBatch, LinearMeasurement
from intent_recognition.gaussian.gaussian_mixture import GaussianMixture
from intent_recognition.gaussian.normal import Gaussian, condition

seeds = st.integers(0, 2**32 - 1)
BUILT = pytest.mark.skipif(KERNEL != "c", reason="the compiled update is not in use")


def random_batch(rng: np.random.Generator, n: int = 5, n_dofs: int = 3, n_basis: int = 20):
    size = n_dofs * n_basis
    root = rng.normal(size=(n, size, size)) / np.sqrt(size)
    covariance = root @ np.swapaxes(root, 1, 2) + 0.05 * np.eye(size)
    return GaussianBatch.of(rng.normal(size=(n, size)), covariance, n_basis)


def a_measurement(rng, n: int, n_dofs: int, n_basis: int, n_deviations: int = 1):
    """Any DOFs in any order; values, noise and transitions of their own or shared."""
    m = int(rng.integers(1, 8))
    root = rng.normal(size=(m, m))
    noise = root @ root.T + 0.1 * np.eye(m)
    own, moves = rng.uniform(size=2) < 0.5
    return LinearMeasurement(
        rng.integers(0, n_dofs, size=m),
        rng.normal(size=(n, n_deviations, n_basis)),
        rng.normal(size=(n, m) if own else m),
        noise * rng.uniform(0.5, 2.0, size=(n, 1, 1)) if own else noise,
        rng.dirichlet(np.ones(n_deviations), size=(n, n_deviations)) if moves else None,
        float(rng.choice([1.0, 0.3])),
        float(rng.choice([np.inf, 4.0])),
    )


@BUILT
@given(seeds)
def test_the_compiled_update_is_that_of_numpy(seed):
    """Of all shapes, of some of the Gaussians in any order, with and without deviations."""
    rng = np.random.default_rng(seed)
    n, n_dofs, n_basis = (int(k) for k in rng.integers(1, [7, 5, 23]))
    n_deviations = int(rng.choice([1, 3, 15]))
    index = rng.permutation(n)[: rng.integers(1, n + 1)] if seed % 2 else None
    one, other = (random_batch(np.random.default_rng(seed), n, n_dofs, n_basis) for _ in range(2))
    deviation = rng.dirichlet(np.ones(n_deviations), size=n)
    deviations = deviation.copy(), deviation
    for _ in range(3):
        k = n if index is None else len(index)
        measurement = a_measurement(rng, k, n_dofs, n_basis, n_deviations)
        found = one.condition(measurement, deviations[0], index)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(batch_module, "KERNEL", "numpy")
            expected = other.condition(measurement, deviations[1], index)
        for a, b in zip(found, expected, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(one.state, other.state, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(*deviations, rtol=1e-9, atol=1e-12)


def test_the_update_in_use_can_be_chosen():
    """By the environment, before the package is imported; `--version` says it."""
    for wanted, expected in (("numpy", "update: numpy"), ("cuda", "c or numpy, got cuda")):
        code = "from intent_recognition.cli.main import main; main(['--version'])"
        run = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"INTENT_KERNEL": wanted},
            capture_output=True,
            text=True,
        )
        assert expected in run.stdout + run.stderr


def test_moments_and_mixture_are_those_that_went_in(rng):
    mean, root = rng.normal(size=(4, 6)), rng.normal(size=(4, 6, 6))
    covariance = root @ np.swapaxes(root, 1, 2)
    batch = GaussianBatch.of(mean, covariance, 2)
    assert np.array_equal(batch.moments()[0], mean)
    assert np.array_equal(batch.moments(np.array([2, 0]))[1], covariance[[2, 0]])
    weight = rng.dirichlet(np.ones(4))
    components = tuple(Gaussian(*parts) for parts in zip(mean, covariance, strict=True))
    moments = GaussianMixture(weight, components).moments
    for ours, expected in zip(batch.mixture(weight), moments, strict=True):
        np.testing.assert_allclose(ours, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("n_deviations", [1, 3])
@pytest.mark.parametrize(
    "bad", ["values", "rows", "noise_covariance", "negative noise", "own noise"]
)
def test_a_refused_measurement_leaves_everything_as_it_was(rng, bad, n_deviations):
    batch, deviation = random_batch(rng), rng.dirichlet(np.ones(n_deviations), size=5)
    before = batch.state.copy(), deviation.copy()
    rows = rng.normal(size=(5, n_deviations, 20))
    good = LinearMeasurement(np.arange(3), rows, np.zeros(3), np.eye(3))
    if bad == "negative noise":
        measurement = good._replace(noise_covariance=-1e6 * np.eye(3))
    elif bad == "own noise":
        noise = np.repeat(np.eye(3)[None], 5, axis=0)
        noise[4] *= -1e6
        measurement = good._replace(noise_covariance=noise)
    else:
        array = getattr(good, bad).copy()
        array.flat[-1] = np.nan
        measurement = good._replace(**{bad: array})
    with pytest.raises(ArgumentError, match=r"innovation covariance.*number|finite|definite"):
        batch.condition(measurement, deviation)
    for ours, expected in zip((batch.state, deviation), before, strict=True):
        assert np.array_equal(ours, expected)


@pytest.mark.parametrize("part", ["rows", "values", "noise_covariance", "transition"])
def test_arrays_that_do_not_fit_are_refused(rng, part):
    measurement = LinearMeasurement(
        np.arange(3), np.ones((5, 2, 20)), np.zeros(3), np.eye(3), np.ones((5, 2, 2))
    )
    wrong = measurement._replace(**{part: getattr(measurement, part)[:-1]})
    with pytest.raises(ShapeError, match=r"measurement: expected rows \(5, 2, 20\)"):
        random_batch(rng).condition(wrong, np.full((5, 2), 0.5))


@BUILT
@pytest.mark.parametrize(
    "change", [{"index": np.array([5])}, {"index": np.array([-1])}, {"dofs": np.array([3])}]
)
def test_nothing_outside_of_the_arrays_is_touched(rng, change):
    index, dofs = change.get("index", np.array([0])), change.get("dofs", np.array([1]))
    measurement = LinearMeasurement(dofs, np.ones((1, 1, 20)), np.zeros(1), np.eye(1))
    with pytest.raises(ValueError, match="do not fit"):
        random_batch(rng).condition(measurement, None, index)


@BUILT
def test_arrays_of_any_layout_are_taken_as_they_are(rng):
    batches = [random_batch(np.random.default_rng(1)) for _ in range(2)]
    rows = rng.normal(size=(20, 1, 5)).T
    values, noise = np.arange(6)[::2], np.eye(3, dtype=np.float32)
    plain = LinearMeasurement(np.arange(3), rows.copy(), values.astype(float), np.eye(3))
    batches[0].condition(LinearMeasurement(np.arange(3, dtype=np.int32), rows, values, noise))
    batches[1].condition(plain)
    assert np.array_equal(batches[0].state, batches[1].state)


@pytest.mark.slow
@pytest.mark.parametrize("resting", [False, True])
def test_thousands_of_nearly_noiseless_updates_keep_a_covariance(resting):
    """The million is a benchmark."""
    rng = np.random.default_rng(4)
    library = make_library(rng, n_basis=20)
    prior = library.observed_covariance[:2]
    block = GaussianBatch.of(np.zeros((2, 60)), prior, 20)
    gram = np.zeros((20, 20))
    noise = 1e-8 * np.eye(3)
    for k in range(2_000):
        phase = np.full(2, 0.37) if resting else rng.uniform(size=2)
        row = library.basis.design_matrix(phase)
        gram += np.outer(row[0], row[0])
        block.condition(LinearMeasurement(np.arange(3), row[:, None], np.zeros(3), noise))
        if k % 500 == 499:
            covariance = block.moments()[1]
            assert np.array_equal(covariance, np.swapaxes(covariance, 1, 2))
            assert np.linalg.eigvalsh(covariance).min() > 0.0
    if resting:  # as good as one observation with a two-thousandth of the noise
        matrix = np.kron(np.eye(3), row[:1])
        nothing = Gaussian(np.zeros(60), prior[0])
        expected = condition(nothing, matrix, np.zeros(3), noise / 2_000)[0].covariance
    else:
        information = np.linalg.inv(prior[0]) + np.kron(np.eye(3), gram) / 1e-8
        expected = np.linalg.inv(information)
    error = np.abs(covariance[0] - expected).max()
    assert error <= 1e-9 * np.abs(prior[0]).max()


def test_new_weights_are_independent_of_the_others_and_may_be_left_out_again(rng):
    root = rng.normal(size=(4, 2 * 5, 2 * 5))
    batch = GaussianBatch.of(rng.normal(size=(4, 2 * 5)), root @ root.swapaxes(1, 2), 5)
    variance = rng.uniform(1.0, 2.0, size=(3, 2, 2))
    wide = batch.resized(np.array([2, 0]), 7, variance)
    mean, covariance = (part.reshape(2, 3, -1, *part.shape[2:]) for part in wide.moments())
    own = (7 * np.arange(2)[:, None] + np.arange(5)).ravel()
    new = np.setdiff1d(np.arange(14), own)
    old_mean, old = batch.moments(np.array([2, 0]))
    assert not mean[:, :, new].any() and not covariance[:, :, own[:, None], new].any()
    for r in range(3):
        np.testing.assert_array_equal(mean[:, r, own], old_mean)
        np.testing.assert_array_equal(covariance[:, r, own[:, None], own], old)
        for of_one in covariance[:, r, new[:, None], new]:
            np.testing.assert_array_equal(of_one, np.diag(variance[r].ravel()))
    again = wide.resized(np.array([0, 3]), 5)
    np.testing.assert_array_equal(again.state, batch.resized(np.array([2, 0]), 5).state)
    np.testing.assert_array_equal(again.moments()[1], old)

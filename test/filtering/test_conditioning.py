# SPDX-License-Identifier: Apache-2.0
"""Weights and phase deviation filtered together, against plain formulas and enumeration."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import bank_of
from scipy.stats import multivariate_normal, multivariate_t
from simulation import START_NS, make_library

from intent_recognition.filtering import MovementFilter, PriorGrid
from intent_recognition.gaussian import Gaussian, GaussianBatch, LinearMeasurement, condition
from intent_recognition.promp import PhaseDeviation, deviation_prior
from intent_recognition.promp import phase_deviation as progress_module
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.phase_deviation import deviation_transition, reference_phase
from intent_recognition.signals.observation import Observation

seeds = st.integers(0, 2**32 - 1)
freedoms = st.sampled_from([np.inf, 4.0])
BRIDGE = np.sqrt(4.0 * np.linspace(0, 1, 51) * np.linspace(1, 0, 51))
LEADING = PhaseDeviation(0.06 * BRIDGE + 0.004, 0.4, 1.0)
N_BASIS = 8


def library_with(
    rng: np.random.Generator, phase_deviation: PhaseDeviation, freedom: float = np.inf
) -> TaskLibrary:
    library = make_library(rng, n_tasks=1, groups=(3,), n_controlled=1, n_basis=N_BASIS)
    return replace(library, phase_deviation=phase_deviation, evidence_freedom=freedom)


def with_known_weights(library: TaskLibrary) -> TaskLibrary:
    return replace(library, weight_covariance=1e-14 * library.weight_covariance)


def start(library: TaskLibrary, *durations_s: float) -> MovementFilter:
    """A filter with these durations of the one task, and of none."""
    n = len(durations_s)
    log_prior = np.full(2 * n, -np.log(2.0 * n))
    return MovementFilter(
        library, PriorGrid(n, np.tile(np.array(durations_s), 2), log_prior), START_NS
    )


def seen(elapsed_s: float, values, dofs=(0, 1, 2), variance: float = 1e-4) -> Observation:
    """Positions of some DOFs with a covariance; the learned noise comes on top of it."""
    stamp_ns = START_NS + round(elapsed_s * 1e9)
    return Observation(stamp_ns, 0, np.asarray(values), variance * np.eye(len(dofs)), tuple(dofs))


def log_density(values, mean, covariance, freedom: float) -> np.ndarray:
    if np.isinf(freedom):
        return multivariate_normal(mean, covariance).logpdf(values)
    return multivariate_t(mean, covariance, df=freedom).logpdf(values)


def random_gaussians(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    size = 3 * N_BASIS
    root = rng.normal(size=(n, size, size)) / np.sqrt(size)
    return rng.normal(size=(n, size)), root @ np.swapaxes(root, 1, 2) + 0.05 * np.eye(size)


def batch_of(mean: np.ndarray, covariance: np.ndarray) -> GaussianBatch:
    return GaussianBatch.of(mean, covariance, N_BASIS)


def a_step(rng: np.random.Generator, n: int, n_deviations: int, freedom: float, exponent: float):
    dofs = rng.permutation(3)[: rng.integers(1, 4)]
    m = len(dofs)
    root = rng.normal(size=(m, m))
    rows = rng.normal(size=(n, n_deviations, N_BASIS))
    noise = root @ root.T + 0.1 * np.eye(m)
    moved = rng.dirichlet(np.ones(n_deviations), size=(n, n_deviations))
    values = rng.normal(size=(n, m))
    return LinearMeasurement(dofs, rows, values, noise, moved, exponent, freedom)


@settings(max_examples=15)
@given(seeds, freedoms, st.sampled_from([1.0, 0.3]))
def test_a_step_is_what_its_formulas_say(seed, freedom, exponent):
    """Mixture over the deviations; then the plain update at the expected basis functions."""
    rng = np.random.default_rng(seed)
    n, n_deviations = 3, 5
    mean, covariance = random_gaussians(rng, n)
    batch, deviation = batch_of(mean, covariance), rng.dirichlet(np.ones(n_deviations), size=n)
    for _ in range(2):
        step = a_step(rng, n, n_deviations, freedom, exponent)
        before = deviation.copy()
        evidence, _ = batch.condition(step, deviation)
        for b in range(n):
            believed = before[b] @ step.transition[b]
            selected = np.eye(3)[step.dofs]
            expected = np.kron(selected, believed @ step.rows[b])
            spread = expected @ covariance[b] @ expected.T + step.noise_covariance
            predicted = [np.kron(selected, row) @ mean[b] for row in step.rows[b]]
            density = np.exp([log_density(step.values[b], p, spread, freedom) for p in predicted])
            assert evidence[b] == pytest.approx(np.log(believed @ density), rel=1e-8, abs=1e-8)
            believed = believed * density**exponent
            believed /= believed.sum()
            np.testing.assert_allclose(deviation[b], believed, rtol=1e-8, atol=1e-12)
            induced = np.cov(np.array(predicted).T, aweights=believed, ddof=0)
            (mean[b], covariance[b]), _ = condition(
                Gaussian(mean[b], covariance[b]),
                np.kron(selected, believed @ step.rows[b]),
                step.values[b],
                step.noise_covariance + induced,
            )
        found = batch.moments()
        np.testing.assert_allclose(found[0], mean, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(found[1], covariance, atol=1e-8)


@pytest.mark.parametrize("late_s", [0.0, 0.06])
@pytest.mark.parametrize("freedom", [np.inf, 4.0])
@pytest.mark.parametrize("exponent", [1.0, 0.4])
def test_filtering_equals_the_enumeration_of_paths(rng, monkeypatch, exponent, freedom, late_s):
    """Of known weights, for then the deviations are a hidden Markov chain, and all is exact.

    A measurement that is late is taken at its own phase and at the present deviation.
    """
    monkeypatch.setattr(progress_module, "N_DEVIATIONS", 3)
    library = with_known_weights(
        library_with(rng, replace(LEADING, evidence=exponent), freedom=freedom)
    )
    run, model, weights = start(library, 2.0), library.phase_deviation, library.weight_mean[0]
    times = np.array([0.3, 0.7, 0.7 - late_s, 1.2, 2.3])
    dofs = [(0, 1), (1,), (0,), (0, 1), (1,)]
    likelihood = np.zeros((5, 3))
    for k, (time, these) in enumerate(zip(times, dofs, strict=True)):
        phase = reference_phase(model, np.array(time / 2.0))
        expected = library.basis.design_matrix(phase) @ weights.reshape(4, -1)[list(these)].T
        values = expected[rng.integers(3)] + 0.02 * rng.normal(size=len(these))
        run.observe(seen(time, values, these, 0.05**2))
        noise = np.diag(library.noise_variance[list(these)] + 0.05**2)
        tails = freedom if k else np.inf  # where a movement begins counts in full
        likelihood[k] = np.exp([log_density(values, mean, noise, tails) for mean in expected])
    moves = [
        deviation_transition(model, np.array(max(b - a, 0.0)) / 2.0)
        for a, b in pairwise(np.maximum.accumulate(times))
    ]
    smoothed, total = np.zeros((5, 3)), 0.0
    for path in product(range(3), repeat=5):
        p = deviation_prior(model)[path[0]]
        for move, a, b in zip(moves, path, path[1:], strict=False):
            p *= move[a, b]
        density = np.prod([likelihood[k, e] for k, e in enumerate(path)])
        total += p * density
        for k, e in enumerate(path):
            smoothed[k, e] += p * density**exponent
    smoothed /= smoothed.sum(axis=1, keepdims=True)
    found = run.prediction(0).deviations_at(np.maximum.accumulate(times))[0]
    np.testing.assert_allclose(found, smoothed, atol=1e-7)
    if exponent == 1.0:
        assert run.log_evidence[0] == pytest.approx(np.log(total), abs=1e-6)


def test_deviations_to_come_drift_back_to_the_prior(rng):
    found = start(library_with(rng, LEADING), 1.0, 2.0).prediction(0)
    found = found.deviations_at(np.array([0.0, 0.5, 9.0]))
    np.testing.assert_array_equal(found, np.broadcast_to(deviation_prior(LEADING), (2, 3, 15)))
    durations = (1.5, 2.0)
    run = start(library_with(rng, LEADING), *durations)
    for time in (0.1, 0.3, 0.35, 0.8):
        run.observe(seen(time, rng.normal(size=3) * 0.1))
    prediction = run.prediction(0)
    first, between, second = prediction.deviations_at(np.array([0.3, 0.31, 0.35])).swapaxes(0, 1)
    np.testing.assert_allclose(between, 0.8 * first + 0.2 * second, atol=1e-12)
    found = prediction.deviations_at(0.8 + np.array([0.0, 0.4, 400.0]))
    np.testing.assert_allclose(found.sum(axis=2), 1.0)
    np.testing.assert_allclose(found[:, 2], np.tile(deviation_prior(LEADING), (2, 1)), atol=1e-9)
    for s, duration in enumerate(durations):
        moved = found[s, 0] @ deviation_transition(LEADING, np.array(0.4 / duration))
        np.testing.assert_allclose(found[s, 1], moved, atol=1e-12)


@pytest.mark.parametrize("freedom", [np.inf, 4.0])
@pytest.mark.parametrize("far", [1.0, 1e3, 1e6])
def test_measurements_far_off_leave_finite_probabilities(rng, far, freedom):
    """Deviations that no float can tell from impossible must come back, at equal stamps too."""
    run = start(library_with(rng, LEADING, freedom), 1.5, 2.0)
    for time, sign in ((0.5, 1), (0.5, -1), (0.5, 1), (0.9, -1), (1.0, 1)):
        run.observe(seen(time, sign * far * np.ones(3), variance=1e-6))
    found = run.prediction(0).deviations_at(np.array([0.2, 0.5, 0.95, 3.0]))
    np.testing.assert_allclose(found.sum(axis=2), 1.0)
    assert np.all(np.isfinite(run.log_evidence))
    assert np.all(np.isfinite(bank_of(run).mean))

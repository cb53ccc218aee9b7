# SPDX-License-Identifier: Apache-2.0
"""Weights and phase deviation filtered together, against joint conditioning and enumeration."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal
from simulation import make_library, minimum_jerk, weights_of

from intent_recognition.filtering.bank import FilterBank, condition_bank
from intent_recognition.filtering.phase_deviation_filter import PhaseDeviationFilter
from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.promp import phase_deviation as progress_module
from intent_recognition.promp.aligned import AlignedPrimitives
from intent_recognition.promp.basis import NormalizedRBFBasis
from intent_recognition.promp.phase_deviation import (
    STEADY,
    PhaseDeviation,
    deviation_grid,
    deviation_prior,
    deviation_transition,
    reference_phase,
)

seeds = st.integers(0, 2**32 - 1)
BRIDGE = np.sqrt(4.0 * np.linspace(0, 1, 51) * np.linspace(1, 0, 51))
LEADING = PhaseDeviation(0.06 * BRIDGE + 0.004, 0.4, 1.0)


def primitives_with(
    rng: np.random.Generator, phase_deviation: PhaseDeviation, n_observed: int = 3
) -> AlignedPrimitives:
    library = make_library(rng, n_tasks=1, groups=(n_observed,), n_controlled=1, n_basis=8)
    return replace(library.primitives, phase_deviation=phase_deviation)


def start(primitives: AlignedPrimitives, duration_s: np.ndarray) -> PhaseDeviationFilter:
    size = primitives.n_observed_weights
    return PhaseDeviationFilter(
        primitives,
        primitives.weight_mean[0, :size],
        primitives.weight_covariance[0, :size, :size],
        np.asarray(duration_s, dtype=float),
    )


def messages(rng: np.random.Generator, n: int, n_observed: int) -> list[tuple]:
    """Times, some of them equal and beyond the end, with any DOFs and covariances."""
    times = np.sort(np.round(rng.uniform(0.0, 3.0, n), 1))
    found = []
    for time in times:
        dofs = np.sort(rng.choice(n_observed, rng.integers(1, n_observed + 1), replace=False))
        root = rng.normal(size=(len(dofs), len(dofs))) * 0.02
        noise = root @ root.T + 1e-4 * np.eye(len(dofs))
        found.append((float(time), dofs, rng.normal(size=len(dofs)) * 0.1, noise))
    return found


@settings(max_examples=15)
@given(seeds, st.integers(1, 3))
def test_steady_progress_equals_conditioning_in_one_step(seed, n_observed):
    rng = np.random.default_rng(seed)
    primitives = primitives_with(rng, STEADY, n_observed)
    size = primitives.n_observed_weights
    seen = messages(rng, 7, n_observed)
    duration = np.array([1.4, 2.0])
    run = start(primitives, duration)
    bank = FilterBank(run.mean.copy(), run.covariance.copy(), np.zeros(2))
    for time, dofs, values, noise in seen:
        run.observe(time, dofs, values, noise)
        rows = primitives.basis.design_matrix(np.clip(time / duration, 0, 1))[:, None]
        bank = condition_bank(bank, dofs, rows, values, noise)
    np.testing.assert_allclose(run.mean, bank.mean, atol=1e-9)
    np.testing.assert_allclose(run.covariance, bank.covariance, atol=1e-9)
    np.testing.assert_allclose(run.log_evidence, bank.log_evidence, rtol=1e-9, atol=1e-9)
    for s in range(2):
        matrix = []
        for time, dofs, _, _ in seen:
            row = primitives.basis.design_matrix(np.array([time / duration[s]]))
            matrix.append(np.kron(np.eye(n_observed)[dofs], row))
        y = np.concatenate([m[2] for m in seen])
        noise = np.zeros((len(y), len(y)))
        at = 0
        for message in seen:
            k = len(message[1])
            noise[at : at + k, at : at + k] = message[3]
            at += k
        prior = Gaussian(
            primitives.weight_mean[0, :size], primitives.weight_covariance[0, :size, :size]
        )
        joint, evidence = condition(prior, np.vstack(matrix), y, noise)
        np.testing.assert_allclose(run.mean[s], joint.mean, atol=1e-8)
        np.testing.assert_allclose(run.covariance[s], joint.covariance, atol=1e-9)
        np.testing.assert_allclose(run.log_evidence[s], evidence, rtol=1e-8, atol=1e-8)


@settings(max_examples=15)
@given(seeds, st.floats(0.1, 2.2))
def test_first_evidence_is_the_mixture_over_deviations(seed, time):
    rng = np.random.default_rng(seed)
    primitives = primitives_with(rng, LEADING._replace(evidence=0.3))
    run = start(primitives, [1.7, 2.0])
    mean, covariance = run.mean.copy(), run.covariance.copy()
    dofs, values = np.array([0, 2]), rng.normal(size=2) * 0.1
    noise = np.array([[4e-4, 1e-4], [1e-4, 2e-4]])
    run.observe(time, dofs, values, noise)
    prior = deviation_prior(primitives.phase_deviation)
    for s, duration in enumerate((1.7, 2.0)):
        recorded = min(time / duration, 1.0)
        scale = np.interp(recorded, np.linspace(0, 1, 51), primitives.phase_deviation.deviation_std)
        phase = np.clip(recorded + scale * deviation_grid(primitives.phase_deviation), 0, 1)
        density = []
        for z in phase:
            H = np.kron(np.eye(3)[dofs], primitives.basis.design_matrix(np.array([z])))
            spread = H @ covariance[s] @ H.T + noise
            density.append(multivariate_normal.logpdf(values, H @ mean[s], spread))
        density = np.array(density)
        expected = np.log(prior @ np.exp(density - density.max())) + density.max()
        np.testing.assert_allclose(run.log_evidence[s], expected, rtol=1e-9, atol=1e-9)
        phase_deviation = prior * np.exp(0.3 * (density - density.max()))
        np.testing.assert_allclose(
            run.phase_deviation[s], phase_deviation / phase_deviation.sum(), rtol=1e-8
        )


@pytest.mark.parametrize("evidence", [1.0, 0.4])
def test_smoothing_equals_the_enumeration_of_all_paths(rng, monkeypatch, evidence):
    """Of known weights, for then the deviations are a hidden Markov chain, and all is exact."""
    monkeypatch.setattr(progress_module, "N_DEVIATIONS", 3)
    primitives = primitives_with(rng, LEADING._replace(evidence=evidence), 2)
    primitives = replace(primitives, weight_covariance=1e-14 * primitives.weight_covariance)
    run, size = start(primitives, [2.0]), primitives.n_observed_weights
    times = [0.3, 0.7, 0.7, 1.2, 2.3]
    dofs = [np.array([0, 1]), np.array([1]), np.array([0]), np.array([0, 1]), np.array([1])]
    weights = primitives.weight_mean[0, :size].reshape(2, -1)
    likelihood = np.zeros((5, 3))
    for k, (time, these) in enumerate(zip(times, dofs, strict=True)):
        phase = reference_phase(primitives.phase_deviation, np.array(time / 2.0))
        expected = primitives.basis.design_matrix(phase) @ weights[these].T
        values = expected[rng.integers(3)] + 0.02 * rng.normal(size=len(these))
        noise = 0.05**2 * np.eye(len(these))
        run.observe(time, these, values, noise)
        likelihood[k] = [multivariate_normal.pdf(values, mean, noise) for mean in expected]
    moves = [
        deviation_transition(primitives.phase_deviation, np.array(b - a) / 2.0)
        for a, b in pairwise(times)
    ]
    smoothed, evidence_sum = np.zeros((5, 3)), 0.0
    for path in product(range(3), repeat=5):
        p = deviation_prior(primitives.phase_deviation)[path[0]]
        for move, a, b in zip(moves, path, path[1:], strict=False):
            p *= move[a, b]
        seen = np.prod([likelihood[k, e] for k, e in enumerate(path)])
        evidence_sum += p * seen
        for k, e in enumerate(path):
            smoothed[k, e] += p * seen**evidence
    smoothed /= smoothed.sum(axis=1, keepdims=True)
    found = run.deviations_at(np.array(times))[0]
    np.testing.assert_allclose(found, smoothed, atol=1e-7)
    np.testing.assert_allclose(run.phase_deviation[0], smoothed[-1], atol=1e-7)
    if evidence == 1.0:
        np.testing.assert_allclose(run.log_evidence[0], np.log(evidence_sum), atol=1e-7)


def test_leads_before_any_observation_are_the_prior(rng):
    run = start(primitives_with(rng, LEADING), [1.0, 2.0])
    found = run.deviations_at(np.array([0.0, 0.5, 9.0]))
    np.testing.assert_array_equal(found, np.broadcast_to(deviation_prior(LEADING), (2, 3, 15)))
    assert run.elapsed_s is None


def test_leads_to_come_drift_back_to_the_prior(rng):
    run = start(primitives_with(rng, LEADING), [1.5, 2.0])
    for time, dofs, values, noise in messages(rng, 6, 3):
        run.observe(time / 3.0, dofs, values, noise)
    later = run.elapsed_s + np.array([0.0, 0.4, 400.0])
    found = run.deviations_at(later)
    np.testing.assert_allclose(found.sum(axis=2), 1.0)
    np.testing.assert_allclose(found[:, 0], run.phase_deviation, atol=1e-12)
    np.testing.assert_allclose(found[:, 2], np.tile(deviation_prior(LEADING), (2, 1)), atol=1e-9)
    for s, duration in enumerate((1.5, 2.0)):
        moved = run.phase_deviation[s] @ deviation_transition(LEADING, np.array(0.4 / duration))
        np.testing.assert_allclose(found[s, 1], moved, atol=1e-12)


def test_hypotheses_are_filtered_apart_each_with_its_values(rng):
    """S hypotheses with priors and values of their own equal S filters of one hypothesis."""
    primitives, n = primitives_with(rng, LEADING), 4
    size = primitives.n_observed_weights
    mean = rng.normal(size=(n, size)) * 0.1
    covariance = primitives.weight_covariance[0, :size, :size] * rng.uniform(0.5, 2, (n, 1, 1))
    duration = rng.uniform(1.0, 3.0, n)
    together = PhaseDeviationFilter(primitives, mean, covariance, duration)
    alone = [
        PhaseDeviationFilter(primitives, mean[s], covariance[s], duration[s : s + 1])
        for s in range(n)
    ]
    for time, dofs, _, noise in messages(rng, 6, 3):
        values = rng.normal(size=(n, len(dofs))) * 0.1
        together.observe(time, dofs, values, noise)
        for s, run in enumerate(alone):
            run.observe(time, dofs, values[s], noise)
    times = np.linspace(0, 4, 9)
    for s, run in enumerate(alone):
        np.testing.assert_allclose(together.mean[s], run.mean[0], atol=1e-10)
        np.testing.assert_allclose(together.covariance[s], run.covariance[0], atol=1e-10)
        np.testing.assert_allclose(together.log_evidence[s], run.log_evidence[0], rtol=1e-9)
        np.testing.assert_allclose(
            together.deviations_at(times)[s], run.deviations_at(times)[0], atol=1e-9
        )


def test_covariances_stay_positive_definite_over_many_steps(rng):
    primitives = primitives_with(rng, LEADING)
    run = start(primitives, [1.5, 2.0, 2.5])
    before = np.trace(run.covariance, axis1=1, axis2=2)
    for time in np.linspace(0.0, 4.0, 800):
        run.observe(time, np.arange(3), rng.normal(size=3) * 0.01, 1e-6 * np.eye(3))
    np.testing.assert_allclose(run.covariance, np.swapaxes(run.covariance, 1, 2), atol=1e-12)
    assert np.linalg.eigvalsh(run.covariance).min() > -1e-12
    assert np.all(np.trace(run.covariance, axis1=1, axis2=2) < before)
    assert np.all(np.isfinite(run.mean))
    np.testing.assert_allclose(run.deviations_at(np.linspace(0, 5, 30)).sum(axis=2), 1.0)


@pytest.mark.parametrize("far", [1.0, 1e3, 1e6])
def test_measurements_far_off_leave_finite_probabilities(rng, far):
    """Leads that no float can tell from impossible must come back, at equal stamps too."""
    primitives = primitives_with(rng, LEADING)
    run = start(primitives, [1.5, 2.0])
    for time, sign in ((0.5, 1), (0.5, -1), (0.5, 1), (0.9, -1), (1.0, 1)):
        run.observe(time, np.arange(3), sign * far * np.ones(3), 1e-6 * np.eye(3))
    found = run.deviations_at(np.array([0.2, 0.5, 0.95, 3.0]))
    np.testing.assert_allclose(found.sum(axis=2), 1.0)
    assert np.all(np.isfinite(run.log_evidence))
    assert np.all(np.isfinite(run.mean))


def test_signals_with_the_same_stamp_may_come_one_after_the_other(rng):
    """With weights known, two DOFs at one stamp are independent evidence of the deviation."""
    primitives = primitives_with(rng, LEADING)
    primitives = replace(primitives, weight_covariance=1e-14 * primitives.weight_covariance)
    once, twice = start(primitives, [2.0]), start(primitives, [2.0])
    for time in (0.4, 0.8, 1.2):
        values = rng.normal(size=3) * 0.1
        once.observe(time, np.arange(3), values, 0.01 * np.eye(3))
        twice.observe(time, np.array([0]), values[:1], 0.01 * np.eye(1))
        twice.observe(time, np.array([1, 2]), values[1:], 0.01 * np.eye(2))
    np.testing.assert_allclose(twice.phase_deviation, once.phase_deviation, atol=1e-9)
    np.testing.assert_allclose(twice.log_evidence, once.log_evidence, atol=1e-9)
    times = np.linspace(0, 3, 13)
    np.testing.assert_allclose(twice.deviations_at(times), once.deviations_at(times), atol=1e-9)


def test_a_signal_may_be_a_little_late(rng):
    run = start(primitives_with(rng, LEADING), [2.0])
    for time in (0.50, 0.48, 0.52):
        run.observe(time, np.arange(1), np.zeros(1), 1e-4 * np.eye(1))
    assert run.elapsed_s == 0.52
    np.testing.assert_allclose(run.deviations_at(np.linspace(0, 2, 9)).sum(axis=2), 1.0)


def known_reach() -> AlignedPrimitives:
    """Two DOFs that reach and swing, nearly the same in every demonstration."""
    basis, phase = NormalizedRBFBasis(25, 1.0), np.linspace(0.0, 1.0, 400)
    shape = np.stack([minimum_jerk(phase), 0.4 * np.sin(2 * np.pi * phase), phase], axis=1)
    mean = weights_of(basis, shape, phase)
    size = mean.size
    covariance = 0.02**2 * (0.98 * np.kron(np.eye(3), np.ones((25, 25))) + 0.02 * np.eye(size))
    noise = np.full(3, 0.005**2)
    phase_deviation = PhaseDeviation(0.08 * BRIDGE + 0.004, 0.4, 1.0)
    return AlignedPrimitives(
        basis, 2, mean.reshape(1, -1), covariance[None], noise, 1.0, phase_deviation
    )


def hesitation(recorded: np.ndarray) -> np.ndarray:
    """Reference phase of a person who stands still from 0.4 to 0.55 and makes up for it."""
    return np.interp(recorded, [0.0, 0.4, 0.55, 1.0], [0.0, 0.45, 0.45, 1.0])


def shift(recorded: np.ndarray) -> np.ndarray:
    """Reference phase of a person who is ahead by 0.1 amid the movement."""
    return recorded + 0.1 * np.sin(np.pi * recorded)


@pytest.mark.parametrize("person", [hesitation, shift])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_persons_progress_is_followed(person, seed):
    rng = np.random.default_rng(seed)
    primitives = known_reach()
    run = start(primitives, [2.0])
    weights = rng.multivariate_normal(primitives.weight_mean[0], primitives.weight_covariance[0])
    times = np.arange(1, 31) / 30 * 2.0
    for time in times:
        row = primitives.basis.design_matrix(person(np.array([time / 2.0])))
        values = (row @ weights.reshape(3, -1).T)[0, :2] + 0.005 * rng.normal(size=2)
        run.observe(time, np.arange(2), values, np.diag(primitives.noise_variance[:2]))
    recorded = times / 2.0
    phase = reference_phase(primitives.phase_deviation, recorded)
    followed = np.sum(run.deviations_at(times)[0] * phase, axis=1)
    truth = person(recorded)
    error, steady = (np.sqrt(np.mean((p - truth) ** 2)) for p in (followed, recorded))
    assert error < 0.5 * steady
    assert error < 0.03

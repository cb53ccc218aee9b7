# SPDX-License-Identifier: Apache-2.0
"""Trajectories against Monte Carlo, finite differences and joint conditioning."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain import run_bank
from simulation import START_NS, make_library, simulate

from intent_recognition.filtering import fixed_prior_grid
from intent_recognition.gaussian.normal import Gaussian, condition
from intent_recognition.promp import NormalizedRBFBasis, dof_variance, rollout
from intent_recognition.promp.prediction import (
    StartPosture,
    controlled_weights,
    end_std_limits,
    least_end_std,
)
from intent_recognition.signals import OnsetSettings, at_rest, end_velocity, is_slow, merge

BASIS = NormalizedRBFBasis(7, 1.0)
seeds = st.integers(0, 2**32 - 1)


def random_weights(rng: np.random.Generator, n_dofs: int) -> Gaussian:
    d = n_dofs * BASIS.n_basis
    root = rng.normal(size=(d, d)) / np.sqrt(d)
    return Gaussian(rng.normal(size=d), root @ root.T + 0.01 * np.eye(d))


@settings(max_examples=20)
@given(seeds, st.floats(0.2, 20.0))
def test_velocities_are_the_derivative_in_time_and_scale_with_duration(seed, duration):
    rng = np.random.default_rng(seed)
    weights = random_weights(rng, 2)
    phase = np.linspace(0.05, 0.95, 30)
    h = 1e-6
    at, before, after = (
        rollout(BASIS, weights, phase + s * h, duration, np.zeros(2)) for s in (0, -1, 1)
    )
    numeric = (after.positions - before.positions) / (2 * h * duration)
    np.testing.assert_allclose(at.velocities, numeric, atol=1e-5 * np.abs(numeric).max())
    slow = rollout(BASIS, weights, phase, 2.0 * duration, np.zeros(2))
    np.testing.assert_allclose(slow.velocities, at.velocities / 2.0)
    np.testing.assert_allclose(slow.times_s, at.times_s * 2.0)
    assert np.array_equal(slow.positions, at.positions)


def test_rollout_equals_samples_of_the_weights(rng):
    weights = random_weights(rng, 2)
    noise = np.array([0.3, 0.7]) ** 2
    phase = np.linspace(0, 1, 9)
    trajectory = rollout(BASIS, weights, phase, 1.5, noise)
    drawn = rng.multivariate_normal(weights.mean, weights.covariance, size=40_000)
    values = np.einsum("tk,sdk->std", BASIS.design_matrix(phase), drawn.reshape(-1, 2, 7))
    values += rng.normal(size=values.shape) * np.sqrt(noise)
    np.testing.assert_allclose(trajectory.positions, values.mean(axis=0), atol=0.03)
    np.testing.assert_allclose(trajectory.std, values.std(axis=0), rtol=0.03)


@pytest.mark.parametrize("start_known", [False, True])
def test_prediction_equals_conditioning_the_joint_gaussian(rng, start_known):
    """Robot's start, if known, and the human's movement in one joint Gaussian, in one step."""
    library = make_library(rng, n_tasks=2, groups=(2,), n_controlled=3, n_basis=6)
    hypotheses = fixed_prior_grid(library, 2.0)
    recording = simulate(library, 0, rng, n_samples=7, duration_s=2.0)
    observations = list(merge(recording.observed))
    bank = run_bank(library, hypotheses, observations, START_NS)
    start = StartPosture(rng.normal(size=3) * 0.1, np.array([1e-4, 4e-4, 9e-4]))
    human_weights = Gaussian(bank.mean[0], bank.covariance[0])
    found = controlled_weights(library, 0, human_weights, start if start_known else None)
    human = [
        np.kron(np.eye(5)[:2], library.basis.design_matrix(np.array([k / 6]))) for k in range(7)
    ]
    robot = np.kron(np.eye(5)[2:], library.basis.design_matrix(np.zeros(1)))
    y = np.concatenate([*(o.values for o in observations), start.position])
    noise = np.r_[
        np.tile(library.noise_variance[:2], 7), start.variance + library.noise_variance[2:]
    ]
    n = None if start_known else 14
    joint, _ = condition(
        library.primitive(0).weights, np.vstack([*human, robot])[:n], y[:n], np.diag(noise[:n])
    )
    split = library.n_observed_weights
    np.testing.assert_allclose(found.mean, joint.mean[split:], atol=1e-8)
    np.testing.assert_allclose(found.covariance, joint.covariance[split:, split:], atol=1e-8)


@settings(max_examples=15)
@given(seeds)
def test_no_end_is_surer_than_with_everything_else_known(seed):
    rng = np.random.default_rng(seed)
    library = make_library(rng, n_tasks=2, n_basis=7, groups=(2,), n_controlled=2)
    task = 1
    least = least_end_std(library, task)
    row, noise = library.basis.design_matrix(np.ones(1)), library.control_noise_variance()
    joint = Gaussian(library.weight_mean[task], library.weight_covariance[task])
    size, total = library.n_observed_weights, joint.mean.size
    start = np.kron(np.eye(2), library.basis.design_matrix(np.zeros(1)))
    seen = np.vstack([np.eye(total)[:size], np.hstack([np.zeros((2, size)), start])])
    exact = np.diag(np.r_[np.full(size, 1e-10), noise])
    given_all, _ = condition(joint, seen, seen @ joint.mean, exact)
    variance = dof_variance(row, given_all.covariance[size:, size:]) + noise
    assert least == {"rad": pytest.approx(np.sqrt(variance.max()), rel=1e-3)}
    unknown = Gaussian(joint.mean[:size], joint.covariance[:size, :size])
    prior = dof_variance(row, controlled_weights(library, task, unknown).covariance) + noise
    assert least["rad"] <= np.sqrt(prior.max())


@pytest.mark.parametrize("exponent", [0.0, 2.0])
def test_the_least_uncertainty_of_an_end_is_that_of_people_as_they_usually_are(rng, exponent):
    library = make_library(rng, n_tasks=2, n_basis=7, groups=(2,), n_controlled=2)
    library = replace(library, regression_variance=0.05, displacement_exponent=exponent)
    size, grown = library.n_observed_weights, np.exp(exponent * library.log_duration_std[0])
    human = library.weight_mean[0, :size], library.weight_covariance[0, :size, :size]
    row = library.basis.design_matrix(np.ones(1)) @ library.basis.scaling(grown)
    exact = np.zeros((size, size))
    variances = [
        dof_variance(row, controlled_weights(library, 0, Gaussian(weights, exact)).covariance)
        for weights in rng.multivariate_normal(*human, size=2000)
    ]
    expected = np.sqrt((np.mean(variances, axis=0) + library.control_noise_variance()).max())
    assert least_end_std(library, 0, start_known=False)["rad"] == pytest.approx(expected, rel=0.02)
    wide = replace(library, weight_covariance=400.0 * library.weight_covariance)
    least = least_end_std(wide, 0, start_known=False)["rad"]
    assert end_std_limits(wide)["task_0"] == {"rad": 1.5 * least} and 1.5 * least > 0.35


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.floats(0.0, 3.0))
def test_what_is_not_slow_is_not_at_rest(seed, n, speed):
    """So that the long look may be skipped."""
    rng = np.random.default_rng(seed)
    onset = OnsetSettings(reference_speed=1.0)
    times = np.cumsum(rng.uniform(0.002, 0.05, size=n))
    values = np.cumsum(rng.normal(size=(n, 2)), axis=0) * 0.01 * speed
    last = times >= times[-1] - onset.window_s - 1e-9
    if not is_slow(onset, end_velocity(onset, times[last], values[last])):
        assert not at_rest(onset, times, values)

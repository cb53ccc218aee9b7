# SPDX-License-Identifier: Apache-2.0
"""Via points, products and blends of primitives, by identities."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from simulation import make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.gaussian import Gaussian, product
from intent_recognition.promp import blend, co_activate, rollout, smooth_switch, via_point

HAND = (3, 4)


@pytest.fixture
def primitives(rng):
    """Two tasks of a human with three and a robot with two DOFs, 1.6 and 2 s long."""
    library = make_library(rng, groups=(3,), n_controlled=2, n_basis=6)
    one, other = library.primitive(0), library.primitive(1)
    return replace(one, duration_s=1.6), replace(other, duration_s=2.0)


@pytest.fixture
def primitive(primitives):
    return primitives[1]


def whole(primitive, times_s):
    """All DOFs of one primitive over time, by the way in which trajectories are predicted."""
    phase = np.asarray(times_s) / primitive.duration_s
    return rollout(
        primitive.basis, primitive.weights, phase, primitive.duration_s, primitive.noise_variance
    )


@pytest.mark.parametrize("time_s", [0.0, 0.7, 2.0])
def test_without_covariance_the_mean_passes_through_the_point(primitive, time_s):
    bent = via_point(primitive, time_s, [0.31, -0.12])
    matrix = bent.observation_matrix(time_s / 2.0, HAND)
    np.testing.assert_allclose(matrix @ bent.weights.mean, [0.31, -0.12], atol=1e-9)
    left = matrix @ bent.weights.covariance @ matrix.T
    before = matrix @ primitive.weights.covariance @ matrix.T
    assert np.abs(left).max() < 1e-9 * np.abs(before).max()


def test_without_limit_a_covariance_changes_nothing_else_it_is_that_of_a_measurement(primitive):
    assert via_point(primitive, 0.7, [1.0, 2.0], covariance=[np.inf, np.inf]) is primitive
    nearly = via_point(primitive, 0.7, [1.0, 2.0], covariance=[1e14, 1e14])
    np.testing.assert_allclose(nearly.weights.mean, primitive.weights.mean, atol=1e-10)
    np.testing.assert_allclose(nearly.weights.covariance, primitive.weights.covariance, atol=1e-10)
    half = via_point(primitive, 0.7, [0.3, np.nan], covariance=[0.0, np.inf])
    alone = via_point(primitive, 0.7, [0.3], dofs=[3])
    np.testing.assert_array_equal(half.weights.mean, alone.weights.mean)
    noise = np.diag(primitive.noise_variance[list(HAND)])
    bent = via_point(primitive, 0.7, [0.3, 0.1], covariance=noise, keep_observed=False)
    measured, _ = primitive.condition(0.35, [0.3, 0.1], dofs=HAND)
    np.testing.assert_allclose(bent.weights.mean, measured.weights.mean, atol=1e-12)
    np.testing.assert_allclose(bent.weights.covariance, measured.weights.covariance, atol=1e-12)


def test_a_wish_for_the_robot_says_nothing_of_the_person(primitive):
    own = slice(0, 18)
    bent = via_point(primitive, 1.2, [0.3, 0.1], covariance=[1e-4, 1e-4])
    np.testing.assert_array_equal(bent.weights.mean[own], primitive.weights.mean[own])
    before = primitive.weights.covariance[own, own]
    np.testing.assert_allclose(bent.weights.covariance[own, own], before, rtol=1e-12)
    assert not np.allclose(bent.weights.mean[18:], primitive.weights.mean[18:])


def test_a_velocity_is_a_point_too(primitive):
    bent = via_point(primitive, 0.8, [0.25], dofs=[4], velocity=True)
    times = np.array([0.8 - 1e-6, 0.8, 0.8 + 1e-6])
    found = whole(bent, times)
    assert found.velocities[1, 4] == pytest.approx(0.25, abs=1e-9)
    slope = (found.positions[2, 4] - found.positions[0, 4]) / 2e-6
    assert slope == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [((2.1, [0, 0]), ArgumentError), ((0.5, [0]), ShapeError), ((0.5, [np.nan, 0]), ArgumentError)],
)
def test_what_is_no_point_of_the_movement_is_refused(primitive, arguments, error):
    with pytest.raises(error):
        via_point(primitive, *arguments)
    with pytest.raises(ArgumentError):
        via_point(primitive, 0.5, [0.0, 0.0], covariance=[np.nan, 0.0])
    with pytest.raises(ArgumentError, match="0 to 4"):
        via_point(primitive, 0.5, [0.0], dofs=[5])


def test_a_primitive_with_itself_or_alone_is_that_one(primitive, primitives):
    same = co_activate([primitive, primitive], [0.3, 0.7])
    np.testing.assert_allclose(same.weights.mean, primitive.weights.mean, atol=1e-9)
    np.testing.assert_allclose(same.weights.covariance, primitive.weights.covariance, atol=1e-9)
    assert same.duration_s == pytest.approx(2.0)
    both = co_activate([primitive, primitive], [1.0, 1.0])
    np.testing.assert_allclose(both.weights.covariance, primitive.weights.covariance / 2, atol=1e-9)
    np.testing.assert_allclose(both.noise_variance, primitive.noise_variance)
    alone = co_activate(primitives, [0.0, 1.0])
    assert alone.weights is primitives[1].weights and alone.duration_s == 2.0


def test_conditioning_and_product_commute(primitives):
    """Told to both, each at half of its weight, an observation counts once."""
    one, other = (replace(p, duration_s=2.0) for p in primitives)
    wrist = [0.1, 0.0, 0.2]
    after = co_activate([one, other], [0.5, 0.5]).condition(0.4, wrist)[0]
    before = co_activate([p.condition(0.4, wrist)[0] for p in (one, other)], [0.5, 0.5])
    np.testing.assert_allclose(after.weights.mean, before.weights.mean, atol=1e-7)


def test_primitives_that_do_not_fit_and_activations_that_are_none(primitives, rng):
    other = make_library(rng, groups=(3,), n_controlled=2, n_basis=7).primitive(0)
    with pytest.raises(ArgumentError, match="same basis"):
        co_activate([primitives[0], other], [1.0, 1.0])
    for activations, got in (([0.0, 0.0], "0 for all"), ([-1.0, 2.0], "-1"), ([np.nan, 1], "nan")):
        with pytest.raises(ArgumentError, match=f"activations: expected .*, got {got}"):
            co_activate(primitives, activations)
    with pytest.raises(ShapeError):
        blend(primitives, [0.0, 1.0], [[1.0, 0.0]])


def test_at_each_time_it_is_the_product_of_the_positions(primitives):
    times = np.array([0.3, 0.8, 1.3])
    shares = np.array([[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]])
    found = blend(primitives, times, shares, dofs=(4, 0, 3))
    for t, share, mean, covariance in zip(
        times, shares, found.positions, found.covariance, strict=True
    ):
        factors = []
        for one in primitives:
            matrix = one.observation_matrix(t / one.duration_s, (4, 0, 3))
            spread = matrix @ one.weights.covariance @ matrix.T + np.diag(
                one.noise_variance[[4, 0, 3]]
            )
            factors.append(Gaussian(matrix @ one.weights.mean, spread))
        expected = product(factors, share)
        np.testing.assert_allclose(mean, expected.mean, atol=1e-9)
        np.testing.assert_allclose(covariance, expected.covariance, atol=1e-10)
        assert np.isfinite(multivariate_normal(mean, covariance).logpdf(mean))


def test_positions_and_velocities_are_smooth_and_belong_together(primitives):
    """The second begins 0.4 s later and takes over between 0.7 and 1.3 s."""
    step = 1e-4
    times = np.arange(0.0, 2.3, step)
    shares, rates = smooth_switch(times, 1.0, 0.6)
    found = blend(primitives, times, shares, rates=rates, starts_s=(0.0, 0.4))
    slopes = (found.positions[2:] - found.positions[:-2]) / (2.0 * step)
    inside = slice(int(0.41 / step), int(1.59 / step))  # where both of them move
    np.testing.assert_allclose(found.velocities[1:-1][inside], slopes[inside], atol=2e-5)
    jumps = np.abs(np.diff(found.velocities[inside], axis=0)).max()
    assert jumps < 0.02 * np.abs(found.velocities).max()
    coarse = blend(primitives, times, shares, starts_s=(0.0, 0.4))  # rates by differences
    np.testing.assert_allclose(coarse.velocities, found.velocities, atol=1e-5)


def test_a_switch_goes_from_one_to_the_other():
    times = np.linspace(0.0, 2.0, 201)
    shares, rates = smooth_switch(times, 1.2, 0.4)
    np.testing.assert_array_equal(shares[times < 0.999], [[1.0, 0.0]] * np.sum(times < 0.999))
    np.testing.assert_allclose(shares[120], [0.5, 0.5], atol=1e-12)
    np.testing.assert_array_equal(shares[-1], [0.0, 1.0])
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.gradient(shares[:, 1], times)[1:-1], rates[1:-1, 1], atol=2e-2)
    with pytest.raises(ArgumentError):
        smooth_switch(times, 1.0, 0.0)

# SPDX-License-Identifier: Apache-2.0
"""The warped space and the primitive in it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.errors import TrainingError
from intent_recognition.warping import References, WarpedPrimitive, from_warped, to_warped

CUP = References(0.04, 4e-4, 0.1, 0.8)
SECOND = References(0.06, 5e-4, 0.06, 0.4)
PHASE = np.linspace(0.0, 1.0, 80)


def paths(count=10, seed=0):
    """Smooth pours whose amplitudes differ."""
    rng = np.random.default_rng(seed)
    shapes = np.stack([np.cos(3 * PHASE), PHASE, 1 + PHASE**2, np.sin(np.pi * PHASE)], axis=1)
    return [shapes * (1.0 + 0.1 * rng.standard_normal(4)) for _ in range(count)]


@given(st.floats(0.2, 5.0), st.integers(0, 100))
def test_there_and_back(size, seed):
    rng = np.random.default_rng(seed)
    offset, tilt = rng.standard_normal((7, 3)), rng.standard_normal(7)
    larger = References(size * 0.04, size**3 * 4e-4, size * 0.1, 0.8)
    back = from_warped(to_warped(offset, tilt, larger, SECOND), larger, SECOND)
    np.testing.assert_allclose(back[0], offset)
    np.testing.assert_allclose(back[1], tilt)
    ones = References(1.0, 1.0, 1.0, 1.0)
    plain = to_warped(offset, tilt, ones, ones)
    np.testing.assert_array_equal(plain, np.column_stack([offset, tilt]))


def test_a_value_of_one_is_the_reference():
    offset, tilt = from_warped(np.ones((1, 4)), CUP, SECOND)
    np.testing.assert_allclose(offset, [[0.06, 0.06, 0.1]])
    np.testing.assert_allclose(tilt, [0.8])


def test_moments_are_those_of_the_demonstrations():
    shown = paths()
    primitive = WarpedPrimitive.learn(shown, np.linspace(5.0, 7.0, 10))
    np.testing.assert_allclose(primitive.mean_path(PHASE), np.mean(shown, axis=0), atol=1e-2)
    std = np.std(shown, axis=0, ddof=1)
    np.testing.assert_allclose(primitive.std_path(PHASE), std, atol=1e-2)
    assert primitive.duration_s == pytest.approx(6.0)


def test_samples_spread_as_the_primitive_says():
    primitive = WarpedPrimitive.learn(paths(), np.ones(10))
    rng = np.random.default_rng(1)
    drawn = np.array([primitive.sample(PHASE, rng) for _ in range(2000)])
    std = primitive.std_path(PHASE)
    error = np.abs(drawn.mean(axis=0) - primitive.mean_path(PHASE))
    assert np.all(error < 5.0 * std / np.sqrt(2000) + 1e-9)
    np.testing.assert_allclose(drawn.std(axis=0), std, rtol=0.1, atol=1e-6)


@pytest.mark.parametrize(
    ("nearest", "free", "stds"),
    [
        (0.5, 4.0, [3.0, 2.0, 1.0, 0.0, 0.0]),
        (0.5, 0.0, [0.0] * 5),
        (1.1, 4.0, 3.0 - 6.0 / 19.0 * np.arange(5.0)),
    ],
    ids=["above it on the way", "always above it", "never above it"],
)
def test_where_a_pour_begins_and_ends_is_free_but_above_the_opening(nearest, free, stds):
    """Smoothly, as far as three radii; what begins and ends above it is as it was shown."""
    away = nearest + free * (PHASE - 0.5) ** 2
    shown = [np.column_stack([away, 0.0 * PHASE, path[:, 2:]]) for path in paths()]
    primitive = WarpedPrimitive.learn(shown, np.ones(10))
    scale = np.repeat([0.06, 0.06, 0.1, 0.8], n := len(at := primitive.basis.centers))
    covariance = primitive.given(CUP, SECOND).weights.covariance / np.outer(scale, scale)
    own = covariance - primitive.spread @ primitive.spread.T
    np.testing.assert_allclose(own, np.kron(np.eye(4), own[:n, :n]), atol=1e-9)
    std = np.sqrt(np.diag(own)[:n])
    np.testing.assert_allclose(std[:5], stds, atol=1e-6)
    np.testing.assert_allclose(std, std[::-1], atol=1e-6)
    assert own[0, 1] == pytest.approx(std[0] * std[1] * np.exp(-0.5 * (at[1] / 0.15) ** 2))


def test_refuses_one_demonstration():
    with pytest.raises(TrainingError, match="two"):
        WarpedPrimitive.learn(paths(1), [5.0])

# SPDX-License-Identifier: Apache-2.0
"""Covariances that tasks are told apart by: half their own, half all tasks' alike."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.promp.prior import (
    OWN_COVARIANCE_SHARE,
    Scatter,
    leave_one_out_scatter,
    observed_block,
    recognition_covariances,
    shrunk_covariance,
    structured_target,
    weight_floor,
)

seeds = st.integers(0, 2**32 - 1)
counts = st.lists(st.integers(1, 5), min_size=1, max_size=4).filter(lambda n: max(n) > 1)


def scatter_of(weights: np.ndarray) -> Scatter:
    flat = (weights - weights.mean(axis=0)).reshape(len(weights), -1)
    return Scatter(flat.T @ flat, len(weights) - 1)


def total(parts: list[Scatter]) -> Scatter:
    return Scatter(sum(p.matrix for p in parts), sum(p.freedom for p in parts))


def demonstrations(seed: int, n: list[int], unit: float = 1.0) -> list[np.ndarray]:
    """Weights of n demonstrations of each task, (n, 2, 6) each."""
    rng = np.random.default_rng(seed)
    return [unit * (rng.normal(size=(2, 6)) + 0.3 * rng.normal(size=(k, 2, 6))) for k in n]


def of(weights: list[np.ndarray], strength: float) -> np.ndarray:
    own = [scatter_of(part) for part in weights]
    floor = weight_floor(np.concatenate(weights))
    return recognition_covariances(own, total(own), floor, strength)


@settings(max_examples=30)
@given(seeds, counts, st.floats(0.1, 300.0), st.floats(1e-3, 1e3))
def test_they_are_symmetric_and_positive_definite_in_any_unit(seed, n, strength, unit):
    found = of(demonstrations(seed, n, unit), strength)
    assert found.shape == (len(n), 12, 12)
    np.testing.assert_allclose(found, np.swapaxes(found, 1, 2), atol=1e-12 * unit**2)
    eigenvalues = np.linalg.eigvalsh(found)
    assert eigenvalues.min() > 1e-9 * eigenvalues.max()
    alike = of(demonstrations(seed, n), strength)
    np.testing.assert_allclose(found, alike * unit**2, rtol=1e-6, atol=1e-9 * unit**2)


def test_identical_demonstrations_leave_them_positive_definite():
    weights = [np.repeat(part[:1], 3, axis=0) for part in demonstrations(1, [1, 1])]
    assert np.linalg.eigvalsh(of(weights, 1.0)).min() > 0.0


@given(seeds, st.integers(2, 6), st.floats(0.1, 100.0))
def test_of_the_only_task_it_is_its_own(seed, n, strength):
    (weights,) = demonstrations(seed, [n])
    scatter, floor = scatter_of(weights), weight_floor(weights)
    target = structured_target(scatter, scatter, floor).covariance()
    expected = shrunk_covariance(scatter.matrix, n, target, strength)
    np.testing.assert_allclose(of([weights], strength)[0], expected, atol=1e-12)


def test_each_equals_its_definition():
    weights, strength = demonstrations(5, [4, 2, 1]), 3.0
    flat = [(w - w.mean(axis=0)).reshape(len(w), -1) for w in weights]
    floor = weight_floor(np.concatenate(weights))
    deviations = np.concatenate(flat)  # of 7 demonstrations about 3 means
    pooled = Scatter(deviations.T @ deviations, 4)
    common = structured_target(pooled, pooled, floor).covariance()
    shared = (deviations.T @ deviations + strength * common) / (4 + strength)
    for part, covariance in zip(flat, of(weights, strength), strict=True):
        n = len(part)
        target = structured_target(Scatter(part.T @ part, n - 1), pooled, floor).covariance()
        own = (part.T @ part + strength * target) / (n - 1 + strength)
        expected = (1 + 1 / n) * (OWN_COVARIANCE_SHARE * own + (1 - OWN_COVARIANCE_SHARE) * shared)
        np.testing.assert_allclose(covariance, expected, atol=1e-12)


def test_tasks_of_alike_scatter_are_alike_and_in_any_order():
    weights = demonstrations(2, [4, 3, 2])
    found = of(weights, 2.0)
    np.testing.assert_allclose(of(weights[::-1], 2.0)[::-1], found, atol=1e-12)
    moved = [weights[0], weights[0] + 1.0]
    one, other = of(moved, 2.0)
    np.testing.assert_allclose(one, other, atol=1e-12)


@pytest.mark.parametrize("index", range(4))
def test_leaving_one_out_equals_never_having_seen_it(index):
    weights = demonstrations(3, [4, 3])
    floor = weight_floor(np.concatenate(weights))
    rest = [np.delete(weights[0], index, axis=0), weights[1]]
    own = [scatter_of(part) for part in rest]
    expected = recognition_covariances(own, total(own), floor, 2.0)[0]
    mine, other = (scatter_of(part) for part in weights)
    deviation = (weights[0][index] - weights[0].mean(axis=0)).ravel()
    part = Scatter(leave_one_out_scatter(mine, deviation), mine.freedom - 1)
    pooled = total([mine, other])
    left = Scatter(pooled.matrix - (mine.matrix - part.matrix), pooled.freedom - 1)
    (found,) = recognition_covariances([part], left, floor, 2.0)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_the_observed_block_is_the_scatter_of_the_observed_weights():
    (weights,) = demonstrations(4, [5])
    found = observed_block(scatter_of(weights), 6)
    expected = scatter_of(weights[:, :1])
    np.testing.assert_allclose(found.matrix, expected.matrix)
    assert found.freedom == expected.freedom == 4

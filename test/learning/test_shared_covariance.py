# SPDX-License-Identifier: Apache-2.0
"""The covariance that tasks share: of all their demonstrations about their own means."""

import numpy as np
import pytest

from intent_recognition.promp import Scatter, TargetSettings, observed_block, shared_covariance
from intent_recognition.promp.prior import OBSERVED_INDEPENDENT, structured_target, weight_floor


def scatter_of(*tasks: np.ndarray) -> Scatter:
    """Of the weights (n, D, N) of each task."""
    flat = [(weights - weights.mean(axis=0)).reshape(len(weights), -1) for weights in tasks]
    return Scatter(sum(w.T @ w for w in flat), sum(len(w) - 1 for w in flat))


def demonstrations(seed: int, n: list[int], unit: float = 1.0) -> list[np.ndarray]:
    """Weights of n demonstrations of each task, (n, 2, 6) each."""
    rng = np.random.default_rng(seed)
    return [unit * (rng.normal(size=(2, 6)) + 0.3 * rng.normal(size=(k, 2, 6))) for k in n]


def of(weights: list[np.ndarray], strength: float) -> np.ndarray:
    return shared_covariance(scatter_of(*weights), weight_floor(np.concatenate(weights)), strength)


def test_means_order_and_single_demonstrations_do_not_matter():
    weights = demonstrations(2, [4, 3])
    pooled, floor = scatter_of(*weights), weight_floor(np.concatenate(weights))
    found = shared_covariance(pooled, floor, 2.0)
    moved = scatter_of(weights[1] + 7.0, weights[0], weights[0][:1] - 3.0)
    np.testing.assert_allclose(shared_covariance(moved, floor, 2.0), found, atol=1e-12)
    (weights,) = demonstrations(4, [5])
    found, expected = observed_block(scatter_of(weights), 6), scatter_of(weights[:, :1])
    np.testing.assert_allclose(found.matrix, expected.matrix)
    assert found.freedom == expected.freedom == 4


@pytest.mark.parametrize("strength", [1e-9, 3.0, 1e9])
def test_it_lies_between_the_sample_covariance_and_the_target(strength):
    weights = demonstrations(5, [4, 2, 1])
    pooled, floor = scatter_of(*weights), weight_floor(np.concatenate(weights))
    assumed = TargetSettings(independent=OBSERVED_INDEPENDENT)
    target = structured_target(pooled, pooled, floor, assumed).covariance()
    share = strength / (strength + 4.0)  # 7 demonstrations about 3 means
    expected = (1.0 - share) * pooled.matrix / 4.0 + share * target
    np.testing.assert_allclose(of(weights, strength), expected, atol=1e-12)

# SPDX-License-Identifier: Apache-2.0
"""The shrunk covariance: positive definite with any number of demonstrations, right with many."""

import numpy as np
import pytest

from intent_recognition.gaussian.normal import Gaussian, log_density
from intent_recognition.promp import LAGS, Scatter, TargetSettings, explained_by_lag, prior
from intent_recognition.promp.prior import (
    predictive_covariance,
    structured_target,
    weight_floor,
    without_demonstration,
)


def scatter_of(weights: np.ndarray) -> Scatter:
    """Of one task, (n, D, N)."""
    flat = (weights - weights.mean(axis=0)).reshape(len(weights), -1)
    return Scatter(flat.T @ flat, len(weights) - 1)


def target_of(weights: np.ndarray) -> np.ndarray:
    """The target of the only task there is."""
    scatter = scatter_of(weights)
    return structured_target(scatter, scatter, weight_floor(weights))


def shrunk(weights: np.ndarray, strength: float) -> np.ndarray:
    scatter = scatter_of(weights)
    return predictive_covariance(scatter, scatter, len(weights), weight_floor(weights), strength)


@pytest.mark.parametrize("n", [2, 5])
@pytest.mark.parametrize(
    "weights", [np.arange(24.0).reshape(3, 8), np.ones((3, 8)), np.zeros((3, 8))]
)
def test_positive_definite_when_demonstrations_are_identical(n, weights):
    covariance = shrunk(np.repeat(weights[None], n, axis=0), 10.0)
    assert np.all(np.isfinite(covariance))
    assert np.linalg.eigvalsh(covariance).min() > 0


@pytest.mark.parametrize("ridge", [0.0, 1e-3])
@pytest.mark.parametrize("borrowed", [0.0, 5.0])
def test_a_task_of_one_demonstration_borrows_from_the_others(rng, borrowed, ridge):
    weights = rng.normal(size=(5, 2, 6))
    nothing = Scatter(np.zeros((12, 12)), 0)
    others = scatter_of(weights[1:])
    assumed = TargetSettings(borrowed, n_observed=1, ridge=ridge)
    covariance = predictive_covariance(nothing, others, 1, weight_floor(weights), 10.0, assumed)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert np.trace(covariance) > np.trace(np.cov(weights[1:].reshape(4, -1).T))


@pytest.mark.parametrize("n", [3, 4, 5, 9])
def test_other_tasks_count_where_they_are_borrowed_and_for_a_task_of_few(rng, n):
    weights, floor = rng.normal(size=(n, 2, 6)), np.full(2, 1e-6)
    own, others = scatter_of(weights), scatter_of(rng.normal(size=(20, 2, 6)))
    assumed = TargetSettings(borrowed=0.0)
    alone = structured_target(own, own, floor, assumed)
    borrowing = structured_target(own, pooled_with(others, own), floor, assumed)
    assert np.array_equal(alone, borrowing) == (n > 4)


def test_strength_moves_to_the_target_and_units_of_dofs_do_not_matter(rng):
    weights = rng.normal(size=(30, 2, 5))
    factor, sample = 1 + 1 / 30, np.cov(weights.reshape(30, -1).T)
    np.testing.assert_allclose(shrunk(weights, 1e-9), factor * sample, rtol=1e-6)
    np.testing.assert_allclose(shrunk(weights, 1e9), factor * target_of(weights), atol=1e-6)
    weights = rng.normal(size=(6, 2, 5))
    units = np.array([1.0, 1000.0])
    rescale = np.kron(np.outer(units, units), np.ones((5, 5)))
    np.testing.assert_allclose(
        target_of(weights * units[:, None]), rescale * target_of(weights), rtol=1e-6
    )


def test_target_recovers_a_matrix_normal_distribution(rng):
    """Where all phases couple the DOFs alike, the target is the truth, given enough draws."""
    root = rng.normal(size=(3, 3))
    grid = np.linspace(0, 1, 6)
    along = np.exp(-0.5 * ((grid[:, None] - grid) / 0.4) ** 2)
    true = np.kron(root @ root.T, along)
    drawn = rng.multivariate_normal(np.zeros(18), true, size=20_000, check_valid="ignore")
    found = target_of(drawn.reshape(-1, 3, 6))
    assert np.linalg.norm(found - true) < 0.05 * np.linalg.norm(true)


def test_target_keeps_a_coupling_that_changes_along_the_phase(rng):
    """Two DOFs that move together at the start and apart at the end: no average over phases."""
    grid = np.linspace(0, 1, 21)
    common, own = rng.normal(size=(2, 20_000, 1)), rng.normal(size=(20_000, 1))
    first = common[0] * (1 - grid) + common[1] * grid
    second = common[0] * (1 - grid) - common[1] * grid + 0.1 * own
    found = target_of(np.stack([first, second], axis=1))
    across = np.diag(found[:21, 21:])
    np.testing.assert_allclose(across[[0, 10, -1]], [1.0, 0.0, -1.0], atol=0.2)


@pytest.mark.parametrize(("n_observed", "parts"), [(0, [0.1, 0.1]), (1, [0.1, 0.0])])
def test_what_is_independent_is_added_to_each_observed_variance(rng, n_observed, parts):
    weights = rng.normal(size=(30, 2, 5)) * np.array([1.0, 3.0])[:, None]
    own, floor = scatter_of(weights), weight_floor(weights)
    usual = structured_target(own, own, floor)
    assumed = TargetSettings(independent=0.1, n_observed=n_observed)
    apart = structured_target(own, own, floor, assumed)
    of_dof = parts * np.mean(np.diag(usual).reshape(2, 5) - floor[:, None], axis=1)
    np.testing.assert_allclose(apart - usual, np.diag(np.repeat(of_dof, 5)), rtol=1e-5, atol=1e-12)


def test_dofs_that_vary_alike_do_so_relative_to_their_ranges(rng):
    own, floor = scatter_of(rng.normal(size=(30, 2, 5))), np.array([1e-6, 9e-6])
    both = structured_target(own, own, floor, TargetSettings(alike=1.0)).reshape(2, 5, 2, 5)
    np.testing.assert_allclose(9.0 * both[0, :, 0], both[1, :, 1], rtol=1e-9)
    np.testing.assert_allclose(both[0, :, 1], 0.0, atol=1e-9)


def test_few_people_differ_slowly_and_by_little_more_than_they_did(rng):
    """Of three degrees of freedom, each the same along the phase: a place, not a detour."""
    weights = np.repeat(rng.normal(size=(4, 2, 1)), 5, axis=2)
    own, floor = scatter_of(weights), weight_floor(weights)
    found = structured_target(own, own, floor, TargetSettings(alike=0.5, slow=0.5))
    found = found.reshape(2, 5, 2, 5)
    variance = (found[0, :, 0] / floor[0] + found[1, :, 1] / floor[1]).diagonal()
    own_variance = np.sum(np.diag(own.matrix).reshape(2, 5) / floor[:, None], axis=0) / 3
    np.testing.assert_allclose(variance, 1.5 * own_variance, rtol=1e-4)
    slow = np.exp(-2.0 * np.linspace(0.0, 1.0, 5) ** 2)
    correlation = found[0, 0, 0] / found[0, 0, 0, 0]
    np.testing.assert_allclose(correlation, (1 + 0.5 * slow) / 1.5, rtol=1e-4)


@pytest.mark.parametrize("steps", [0, 2, 4])
def test_the_lag_of_a_robot_that_copies_the_hand_is_found(rng, steps):
    """Independent weights, so that any other lag explains nothing; 21 of them are 0.05 apart."""
    hand = rng.normal(size=(400, 2, 21))
    robot = np.concatenate([np.repeat(hand[:, :, :1], steps, 2), hand[:, :, : 21 - steps]], axis=2)
    weights = np.concatenate([hand, robot + 0.1 * rng.normal(size=robot.shape)], axis=1)
    own, floor = scatter_of(weights), weight_floor(weights)
    explained = explained_by_lag(own, 2, floor)
    assert LAGS[np.argmax(explained)] == pytest.approx(0.05 * steps) and explained.max() > 0.8
    found = structured_target(own, own, floor, TargetSettings(lag=0.05 * steps, n_observed=2))
    np.testing.assert_allclose(np.diag(found), np.var(weights, axis=0).ravel(), rtol=0.25)
    across = found.reshape(4, 21, 4, 21)[0, :, 2]
    np.testing.assert_allclose(across[: 21 - steps, steps:].diagonal(), 1.0, atol=0.2)
    if steps:
        np.testing.assert_allclose(np.diag(across)[steps + 1 :], 0.0, atol=0.2)


def left_out_log_density(rng, n: int) -> float:
    """Mean over tasks of how probable one more demonstration is, smooth ones drawn at random."""
    phase = np.linspace(0.0, 1.0, 12)
    smooth = np.exp(-0.5 * ((phase[:, None] - phase) / 0.2) ** 2)
    true = np.kron([[1.0, 0.5], [0.5, 1.0]], smooth) + 1e-4 * np.eye(24)
    density = []
    for _ in range(30):
        draws = rng.multivariate_normal(np.zeros(24), true, size=n + 1)
        learned = Gaussian(draws[1:].mean(axis=0), shrunk(draws[1:].reshape(n, 2, 12), 1.0))
        density.append(log_density(learned, draws[0]))
    return float(np.mean(density))


@pytest.mark.parametrize("n", [2, 3])
def test_few_demonstrations_of_one_task_are_not_taken_for_all_there_is(monkeypatch, n):
    doubted = left_out_log_density(np.random.default_rng(n), n)
    monkeypatch.setattr(prior, "FEW", 0.0)
    taken_as_they_are = left_out_log_density(np.random.default_rng(n), n)
    assert doubted > taken_as_they_are + 10.0


def test_many_demonstrations_are_not_inflated_and_at_rest_is_a_floor(monkeypatch, rng):
    weights = rng.normal(size=(20, 2, 6))
    doubted = target_of(weights)
    monkeypatch.setattr(prior, "FEW", 0.0)
    np.testing.assert_allclose(doubted, target_of(weights), atol=1e-3 * np.abs(doubted).max())
    floor = weight_floor(np.zeros((3, 2, 5)))
    assert np.all(floor > 0)
    moved = weight_floor(np.array([[[0.0, 10.0]], [[0.0, 10.0]]]))
    np.testing.assert_allclose(np.sqrt(moved), 0.01)


def pooled_with(other: Scatter, own: Scatter) -> Scatter:
    return Scatter(own.matrix + other.matrix, own.freedom + other.freedom)


@pytest.mark.parametrize("n", [2, 3, 6])
@pytest.mark.parametrize("n_others", [2, 4])
def test_target_without_one_is_that_of_the_others(rng, n, n_others):
    """Against fitting it again to the demonstrations that are left."""
    weights, others = rng.normal(size=(n, 3, 5)), scatter_of(rng.normal(size=(n_others, 3, 5)))
    floor, own = weight_floor(weights), scatter_of(weights)
    deviations = weights - weights.mean(axis=0)
    for i in range(n):
        part = without_demonstration(pooled_with(others, own), own, deviations[i].ravel())
        found = structured_target(*part, floor)
        rest = scatter_of(np.delete(weights, i, axis=0))
        expected = structured_target(rest, pooled_with(others, rest), floor)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)

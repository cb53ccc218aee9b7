# SPDX-License-Identifier: Apache-2.0
"""The cost of warps: its derivatives, what it does not see, and that a descent only descends."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.alignment.timed import demonstrations
from intent_recognition.alignment.fit import (
    Curves,
    WarpProblem,
    descend,
    local_cost,
    recorded_phase,
    total_cost,
)
from intent_recognition.alignment.search import search
from intent_recognition.alignment.warp import slope_basis

seeds = st.integers(0, 2**32 - 1)
K, GRID = 7, 41


def problem_of(rng: np.random.Generator, n: int = 4, **kwargs) -> WarpProblem:
    """Demonstrations 1 to n beside demonstration 0."""
    kinds = {"n_samples": GRID, "noise": 0.02, "variety": 0.05, "shift_std": 0.03} | kwargs
    samples = demonstrations(rng, n=n + 1, **kinds).trajectories * 20.0
    return WarpProblem(
        Curves.through(samples[1:]), samples[0], slope_basis(K, GRID), 10.0 * np.eye(K), 0.05, 30.0
    )


def parameters_of(rng: np.random.Generator, n: int = 4) -> np.ndarray:
    return np.column_stack([0.03 * rng.normal(size=n), 0.3 * rng.normal(size=(n, K))])


def test_curves_are_exact_on_parabolas_and_held_outside():
    phase = np.linspace(0.0, 1.0, 21)
    curves = Curves.through((3.0 * phase**2 - phase)[None, :, None])
    at = np.array([[0.2, 0.333, 0.5, 0.77]])
    values, slope = curves.at(at)
    np.testing.assert_allclose(values[0, :, 0], 3.0 * at[0] ** 2 - at[0], atol=1e-12)
    np.testing.assert_allclose(slope[0, :, 0], 6.0 * at[0] - 1.0, atol=1e-10)
    values, slope = curves.at(np.array([[-0.5, 1.5]]))
    np.testing.assert_allclose(values[0, :, 0], [0.0, 2.0], atol=1e-12)
    assert np.all(slope == 0.0)


@pytest.mark.slow
@given(seeds)
def test_gradient_equals_finite_differences(seed):
    rng = np.random.default_rng(seed)
    problem, parameters = problem_of(rng), parameters_of(rng)
    gradient = local_cost(problem, parameters).gradient
    for k in range(K + 1):
        step = np.zeros(K + 1)
        step[k] = 1e-6
        higher = total_cost(problem, parameters + step)
        numeric = (higher - total_cost(problem, parameters - step)) / 2e-6
        # Where a sample crosses the end of a recording the slope jumps: no derivative there.
        phase, _ = recorded_phase(problem.basis, parameters)
        smooth = np.min(np.minimum(np.abs(phase), np.abs(phase - 1.0)), axis=1) > 1e-5
        np.testing.assert_allclose(gradient[smooth, k], numeric[smooth], rtol=1e-3, atol=2e-3)


@given(seeds)
def test_a_demonstration_moved_aside_costs_the_same(seed):
    rng = np.random.default_rng(seed)
    problem, parameters = problem_of(rng), parameters_of(rng)
    aside = problem._replace(reference=problem.reference + rng.normal(0.0, 50.0, 3))
    np.testing.assert_allclose(
        total_cost(aside, parameters), total_cost(problem, parameters), rtol=1e-9
    )


@pytest.mark.slow
@given(seeds, st.integers(1, 8))
def test_a_descent_never_climbs_and_reports_its_cost(seed, n_iterations):
    rng = np.random.default_rng(seed)
    problem, start = problem_of(rng), parameters_of(rng)
    found, cost = descend(problem, start, n_iterations)
    assert np.all(cost <= total_cost(problem, start))
    np.testing.assert_allclose(cost, total_cost(problem, found), rtol=1e-9)


def test_a_descent_ends_where_the_gradient_vanishes(rng):
    problem = problem_of(rng, variety=0.0)
    found, _ = descend(problem, np.zeros((4, K + 1)), 100)
    local = local_cost(problem, found)
    promise = np.einsum(
        "nk,nk->n",
        local.gradient,
        np.linalg.solve(local.curvature, local.gradient[..., None])[..., 0],
    )
    assert np.all(0.5 * promise < 0.1)  # nats


def test_the_search_finds_an_oscillation_a_descent_alone_misses():
    phase = np.linspace(0.0, 1.0, GRID)
    wave = np.sin(2 * np.pi * 5 * phase) * np.exp(-(((phase - 0.5) / 0.25) ** 4))
    late = np.interp(phase, [0.0, 0.35, 0.65, 1.0], [0.0, 0.23, 0.53, 1.0])
    samples = 20.0 * np.stack([wave, np.interp(late, phase, wave)])[..., None]
    problem = WarpProblem(
        Curves.through(samples[1:]), samples[0], slope_basis(12, GRID), 5.0 * np.eye(12), 0.05, 30.0
    )
    alone = descend(problem, np.zeros((1, 13)), 50)[1]
    searched = descend(problem, search(problem, 0.3, 0.1), 50)[1]
    assert searched[0] < 0.5 * alone[0]


def test_the_search_leaves_alone_what_tells_nothing():
    samples = np.ones((3, GRID, 2))
    problem = WarpProblem(
        Curves.through(samples), samples[0], slope_basis(K, GRID), np.eye(K), 0.05, 30.0
    )
    np.testing.assert_allclose(search(problem, 0.3, 0.1), 0.0, atol=1e-12)

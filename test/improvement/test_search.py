# SPDX-License-Identifier: Apache-2.0
"""Practice looks inside the primitive's own spread and goes on where it was interrupted."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.improvement import CovarianceSearch, search_space, settled_point
from intent_recognition.improvement import search as module
from intent_recognition.improvement.search import next_point
from intent_recognition.promp import NormalizedRBFBasis

PHASE = np.linspace(0.0, 1.0, 30)


def primitive(n_dofs: int = 2, n_basis: int = 6, n_shown: int = 8):
    """Mean (d,), spread (d, n_shown) and design (Q, m, d) of a few random demonstrations."""
    rng = np.random.default_rng(3)
    basis = NormalizedRBFBasis(n_basis).design_matrix(PHASE)
    design = np.einsum("qp,mn->qmpn", np.eye(n_dofs), basis).reshape(n_dofs, len(PHASE), -1)
    shown = rng.normal(size=(n_shown, n_dofs * n_basis)) * rng.uniform(0.2, 2.0, n_dofs * n_basis)
    mean = shown.mean(axis=0)
    return mean, (shown - mean).T / np.sqrt(n_shown - 1.0), design


def allow(_):
    return True


def run(search, space, cost, n, limits=allow):
    points, costs = np.empty((0, space.n_axes)), np.empty(0)
    for _ in range(n):
        point = next_point(search, space, points, costs, limits)
        points, costs = np.vstack([points, point]), np.append(costs, cost(space.weights(point)))
    return points, costs


def test_a_linear_change_of_the_weights_changes_no_path():
    mean, spread, design = primitive()
    rng = np.random.default_rng(0)
    change = rng.normal(size=(len(mean), len(mean))) + 3.0 * np.eye(len(mean))
    unit = np.array([100.0, 0.3])[:, None, None]
    space = search_space(mean, spread, design)
    back = np.linalg.inv(change)
    other = search_space(change @ mean, change @ spread, unit * (design @ back))
    assert space.n_axes == other.n_axes < spread.shape[1]
    signs = np.sign(np.sum((back @ other.axes) * space.axes, axis=0))
    wanted = design @ space.mean
    for k in range(20):
        point = np.random.default_rng(k).normal(size=space.n_axes)
        here = design @ space.weights(point)
        there = unit * (design @ back) @ other.weights(signs * point)
        assert np.allclose(unit[..., 0] * here, there, rtol=0, atol=1e-7)

    # The same search, then, with the cost of a path.
    def costs_of(axes, design):
        def cost(weights):
            return float(np.sum((design @ weights - wanted - 0.5) ** 2))

        return run(search, axes, cost, 30)[1]

    search = CovarianceSearch(space.n_axes, seed=1)
    turned = replace(other, axes=other.axes * signs)
    assert np.allclose(costs_of(space, design), costs_of(turned, design @ back), rtol=1e-6)


def test_all_axes_together_are_the_primitives_covariance(monkeypatch):
    monkeypatch.setattr(module, "HELD", 1.0)
    mean, spread, design = primitive()
    space = search_space(mean, spread, design)
    assert space.n_axes == spread.shape[1] - 1  # deviations from their own mean
    assert np.allclose(space.axes @ space.axes.T, spread @ spread.T)
    point = np.random.default_rng(1).normal(size=space.n_axes)
    away = space.weights(point) - mean
    assert away @ np.linalg.pinv(spread @ spread.T) @ away == pytest.approx(point @ point)


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=25),
    st.integers(0, 1000),
    st.floats(0.1, 3.0),
)
def test_whatever_the_costs_no_dof_leaves_its_tube(costs, seed, bound):
    mean, spread, design = primitive()
    space = replace(search_space(mean, spread, design), bound=bound)
    std = np.sqrt(np.sum((design @ spread) ** 2, axis=2))
    search = CovarianceSearch(space.n_axes, seed, step=2.0)
    told = iter(costs)

    def highest(weights):
        return bool(np.all(design @ weights <= design @ mean + std))  # limits of the arm

    points, _ = run(search, space, lambda _: next(told), len(costs), highest)
    settled = settled_point(search, space, points, np.array(costs), highest)
    for point in (*points, settled):
        away = design @ space.weights(point) - design @ mean
        assert np.linalg.norm(point) <= bound * (1.0 + 1e-12)
        assert np.all(np.abs(away) <= bound * std * (1.0 + 1e-9))
        assert highest(space.weights(point))


@pytest.mark.slow
@pytest.mark.parametrize("away", [0.8, 3.0])
def test_the_optimum_of_a_quadratic_cost_is_found_inside_the_bound(monkeypatch, away):
    """The optimum itself where it is inside, else the nearest point of the bound."""
    monkeypatch.setattr(module, "HELD", 0.9)
    mean, spread, design = primitive()
    space = search_space(mean, spread, design)
    direction = np.linspace(1.0, 2.0, space.n_axes) / np.linalg.norm(
        np.linspace(1.0, 2.0, space.n_axes)
    )
    goal = away * direction
    inverse = np.linalg.pinv(space.axes)

    def cost(weights):
        return float(np.sum((inverse @ (weights - mean) - goal) ** 2))

    search = CovarianceSearch(space.n_axes, seed=2)
    points, costs = run(search, space, cost, 110)
    settled = settled_point(search, space, points, costs, allow)
    assert np.allclose(settled, min(away, 2.0) * direction, atol=0.1)


def test_a_search_goes_on_where_it_was_to_the_bit():
    mean, spread, design = primitive()
    space = search_space(mean, spread, design)
    noise = np.random.default_rng(8).normal(size=60)

    told = iter(noise)
    before = np.random.get_state()[1].copy()  # noqa: NPY002  # nobody else's numbers are drawn
    whole = CovarianceSearch(space.n_axes, seed=4)
    points, costs = run(whole, space, lambda _: next(told), 60)
    for kept in range(0, 60, 7):
        resumed = CovarianceSearch(space.n_axes, seed=4)
        again = next_point(resumed, space, points[:kept], costs[:kept], allow)
        assert np.array_equal(again, points[kept])
    assert np.array_equal(np.random.get_state()[1], before)  # noqa: NPY002


def test_what_could_not_be_done_is_dear_and_ends_nothing():
    mean, spread, design = primitive()
    space = search_space(mean, spread, design)
    search = CovarianceSearch(space.n_axes, seed=4)
    impossible = space.weights(np.zeros(space.n_axes))[0]

    def cost(weights):
        return np.inf if weights[0] > impossible else float(weights[0])

    points, costs = run(search, space, cost, 40)
    assert np.isinf(costs).any()
    settled = settled_point(search, space, points, costs, allow)
    assert np.isfinite(cost(space.weights(settled)))
    _, never = run(search, space, lambda _: np.inf, 20)
    assert np.isinf(never).all()


def test_a_primitive_that_cannot_be_practised_is_named():
    mean, spread, design = primitive()
    with pytest.raises(ArgumentError, match="varies"):
        search_space(mean, 0.0 * spread, design)
    space = search_space(mean, spread, design)
    search = CovarianceSearch(space.n_axes, seed=4)
    with pytest.raises(ArgumentError, match="mean inside the limits"):
        points = np.zeros((1, space.n_axes))
        next_point(search, space, points, np.zeros(1), lambda _: False)

# SPDX-License-Identifier: Apache-2.0
"""The interaction primitive of one task at known phase."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from simulation import make_library

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.promp.interaction import InteractionProMP

PHASES = np.array([0.1, 0.35, 0.4, 0.8])


@pytest.fixture
def library(rng):
    return make_library(rng, groups=(3,), n_controlled=2, n_basis=6)


@pytest.fixture
def promp(library) -> InteractionProMP:
    return library.primitive(1)


@pytest.fixture
def values(rng) -> np.ndarray:
    return 0.1 * rng.normal(size=(len(PHASES), 3))


def same_weights(one: InteractionProMP, other: InteractionProMP) -> None:
    np.testing.assert_allclose(one.weights.mean, other.weights.mean, rtol=0, atol=1e-10)
    np.testing.assert_allclose(one.weights.covariance, other.weights.covariance, rtol=0, atol=1e-12)


def test_one_after_the_other_equals_all_at_once_in_any_order(promp, values):
    together, log_evidence = promp.condition(PHASES, values)
    for order in (range(4), (2, 0, 3, 1)):
        recursive, total = promp, 0.0
        for k in order:
            recursive, density = recursive.condition(PHASES[k], values[k])
            total += density
        same_weights(recursive, together)
        assert total == pytest.approx(log_evidence, abs=1e-9)


def test_the_evidence_is_the_density_of_the_stacked_samples(promp, values):
    matrix = promp.observation_matrix(PHASES, range(3))
    mean = matrix @ promp.weights.mean
    covariance = matrix @ promp.weights.covariance @ matrix.T
    covariance += np.kron(np.eye(len(PHASES)), np.diag(promp.noise_variance[:3]))
    expected = multivariate_normal(mean, covariance).logpdf(values.ravel())
    assert promp.condition(PHASES, values)[1] == pytest.approx(expected, abs=1e-8)


def test_a_dof_that_is_not_observed_has_no_row(promp, values):
    matrix = promp.observation_matrix(PHASES, [2, 0])
    assert matrix.shape == (2 * len(PHASES), 5 * promp.basis.n_basis)
    blocks = matrix.reshape(len(PHASES), 2, 5, -1)
    assert not blocks[:, 0, [0, 1, 3, 4]].any() and not blocks[:, 1, 1:].any()
    in_turn = promp.condition(PHASES, values[:, [0]], dofs=[0])[0]
    in_turn = in_turn.condition(PHASES, values[:, [2]], dofs=[2])[0]
    same_weights(promp.condition(PHASES, values[:, [2, 0]], dofs=[2, 0])[0], in_turn)


def test_conditioning_changes_no_argument_and_lowers_the_variance(promp, values):
    before = promp.weights.mean.copy(), promp.weights.covariance.copy()
    posterior, _ = promp.condition(PHASES, values)
    assert np.array_equal(promp.weights.mean, before[0])
    assert np.array_equal(promp.weights.covariance, before[1])
    smaller = before[1] - posterior.weights.covariance
    assert np.linalg.eigvalsh(smaller).min() > -1e-10
    for agent in ("predict_observed", "predict_controlled"):
        prior_std = getattr(promp, agent)(5).std
        assert np.all(getattr(posterior, agent)(5).std <= prior_std + 1e-12)


def test_what_is_no_number_is_named_and_a_controlled_dof_may_be_observed(promp):
    start = [0.3, -0.2]
    exact, _ = promp.condition(0.0, start, dofs=[3, 4])
    vague, _ = promp.condition(0.0, start, dofs=[3, 4], covariance=1e6 * np.eye(2))
    for found, tolerance, expected in (
        (exact, 0.05, start),
        (vague, 1e-3, promp.predict_controlled(2).positions[0]),
    ):
        np.testing.assert_allclose(
            found.predict_controlled(2).positions[0], expected, atol=tolerance
        )
    with pytest.raises(ShapeError, match="values: expected an array of numbers"):
        promp.condition(0.5, "abc")
    with pytest.raises(ShapeError, match="phase: expected an array of numbers"):
        promp.condition("x", [0.1, 0.2, 0.3])
    with pytest.raises(ArgumentError, match=r"dofs: expected numbers from 0 to 4, got \['x'\]"):
        promp.condition(0.5, [0.1], dofs=["x"])
    with pytest.raises(ArgumentError, match="n_points: expected a whole number from 1 on, got 0"):
        promp.predict_controlled(0)


@pytest.mark.parametrize(
    ("phase", "values", "options", "error", "says"),
    [
        (0.5, np.zeros(2), {}, ShapeError, r"values: expected shape \(3,\)"),
        (0.5, np.zeros((1, 3)), {}, ShapeError, r"values: expected shape \(3,\)"),
        ([0.5, 0.6], np.zeros(3), {}, ShapeError, r"values: expected shape \(2, 3\)"),
        ([[0.5]], np.zeros((1, 1, 3)), {}, ShapeError, "phase"),
        (np.nan, np.zeros(3), {}, ArgumentError, "phase: expected finite"),
        (1.7, np.zeros(3), {}, ArgumentError, r"phase: expected numbers in \[0, 1\]"),
        (-0.1, np.zeros(3), {}, ArgumentError, r"phase: expected numbers in \[0, 1\]"),
        (0.5, [0.0, np.nan, 0.0], {}, ArgumentError, "values: expected finite"),
        (0.5, np.zeros(3), {"covariance": np.eye(2)}, ShapeError, "covariance"),
        (0.5, np.zeros(3), {"covariance": -np.eye(3)}, ArgumentError, "innovation covariance"),
        (0.5, np.zeros(1), {"dofs": [5]}, ArgumentError, "dofs: expected numbers from 0 to 4"),
        (0.5, np.zeros(0), {"dofs": []}, ArgumentError, "dofs"),
    ],
)
def test_what_cannot_be_conditioned_on(promp, phase, values, options, error, says):
    with pytest.raises(error, match=says):
        promp.condition(phase, values, **options)

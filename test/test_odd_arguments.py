# SPDX-License-Identifier: Apache-2.0
"""Odd arguments of public functions give the right result, or an error that names them."""

import numpy as np
import pytest

import intent_recognition as ir

MEAN, COVARIANCE = [0.0, 1.0], [[1.0, 0.5], [0.5, 2.0]]
PRIOR = ir.Gaussian(np.array(MEAN), np.array(COVARIANCE))
H, Y, R = [[1, 0]], [1], [[0.25]]
TIMES_S = np.linspace(0.0, 2.0, 50)
SHARE = np.clip(TIMES_S - 0.5, 0.0, 1.0)[:, None]
PLACES = SHARE**2 * (3 - 2 * SHARE) * np.array([0.5, 0.2, 0.3])
RECORDED = ir.Demonstration.from_arrays(TIMES_S, PLACES, PLACES, controlled_unit="m")


@pytest.mark.parametrize("make", [list, tuple, np.float32])
def test_a_normal_distribution_of_any_numbers_is_conditioned_alike(make):
    matrix, noise = make(H), make(R)
    prior = ir.Gaussian(MEAN, COVARIANCE if make is list else make(COVARIANCE))
    expected, evidence = ir.condition(PRIOR, np.array(H), np.array(Y), np.array(R))
    found, of_lists = ir.condition(prior, matrix, Y, noise)
    np.testing.assert_array_equal(found.mean, expected.mean)
    np.testing.assert_array_equal(found.covariance, expected.covariance)
    np.testing.assert_allclose(found.mean, [0.8, 1.4])  # gain 1 / 1.25 of a deviation of 1
    assert of_lists == evidence
    np.testing.assert_array_equal(ir.marginal(prior, [1]).covariance, [[2.0]])


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda: ir.condition("x", H, Y, R), ir.ArgumentError, "prior: expected a Gaussian"),
        (lambda: ir.condition((MEAN, [1, 2]), H, Y, R), ir.ArgumentError, "one of type tuple"),
        (lambda: ir.condition(ir.Gaussian(MEAN, [1, 2]), H, Y, R), ir.ShapeError, "numpy.diag"),
        (lambda: ir.condition(PRIOR, [1, 0], Y, R), ir.ShapeError, r"H \(2,\)"),
        (lambda: ir.marginal(PRIOR, [5]), ir.ArgumentError, r"index: .* below 2, got \[5\]"),
        (lambda: ir.marginal(PRIOR, [0.5]), ir.ArgumentError, "index: expected whole numbers"),
        (lambda: ir.align(RECORDED), ir.ShapeError, "trajectories: .* got one Demonstration"),
        (lambda: ir.align([RECORDED] * 2), ir.ShapeError, r"trajectories\[0\]: .*array of numbers"),
        (lambda: ir.settle_orientations("d.yaml", []), ir.ArgumentError, "dofs: .*load_dofs"),
        (lambda: ir.reliability_bins([0.1, 1.9], [0, 1]), ir.ArgumentError, "got 1.9"),
        (lambda: ir.reliability_bins([np.nan], [1]), ir.ArgumentError, "probabilities: .*got nan"),
        (lambda: ir.reliability_bins([0.1], [0, 1]), ir.ShapeError, r"\(1,\) and \(2,\)"),
        (lambda: ir.reliability_bins([0.1], [1], 0), ir.ArgumentError, "n_bins: .*from 1 on"),
    ],
)
def test_an_error_names_the_argument(call, error, said):
    with pytest.raises(error, match=said):
        call()

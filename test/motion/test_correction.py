# SPDX-License-Identifier: Apache-2.0
"""A corrected path is the primitive conditioned on where the arm was left."""

import numpy as np
from simulation import make_library

from intent_recognition.gaussian import Gaussian, condition
from intent_recognition.kinematics import JointLimits
from intent_recognition.motion import DeviationDetector, Spread, Via, make_path, phase_of, with_via
from intent_recognition.motion.correction import Correction, corrected_by
from intent_recognition.promp import via_point

WIDE = JointLimits(np.full(2, -9.0), *(np.full(2, 9.0) for _ in range(4)))
PHASES = np.linspace(0.0, 1.0, 61)
PRIMITIVE = make_library(np.random.default_rng(4)).primitive(0)
SPREAD = Spread.given_person(PRIMITIVE)


def seen(primitive):
    """The primitive after some of the person's movement, and its controlled mean as a path."""
    matrix = primitive.observation_matrix(np.array([0.2, 0.4]), [0, 1, 2])
    values = matrix @ primitive.weights.mean + 0.01
    weights, _ = condition(primitive.weights, matrix, values, 1e-6 * np.eye(len(values)))
    means = weights.mean.reshape(primitive.n_dofs, -1)[primitive.n_observed :]
    positions = primitive.basis.design_matrix(PHASES) @ means.T
    return weights, make_path(PHASES * primitive.duration_s, positions, WIDE)


def controlled_mean(primitive):
    own = primitive.weights.mean.reshape(primitive.n_dofs, -1)[primitive.n_observed :]
    return primitive.basis.design_matrix(PHASES) @ own.T


def test_it_equals_conditioning_the_primitive_before_or_after_the_person():
    """Start fixed, then the correction, then what the person does: any order is the same."""
    weights, path = seen(PRIMITIVE)
    left = np.array(path.spline(0.7)) + [0.05, -0.03]
    duration = PRIMITIVE.duration_s
    posterior = PRIMITIVE.__class__(
        PRIMITIVE.basis, weights, PRIMITIVE.n_observed, PRIMITIVE.noise_variance, duration
    )
    start = via_point(posterior, 0.0, path.spline(0.0), covariance=np.zeros(2))
    expected = via_point(start, 0.7 * duration, left, covariance=np.full(2, 1e-6))
    moved = corrected_by(SPREAD, path, [Via(0.7, left)], PHASES)
    np.testing.assert_allclose(path.spline(PHASES) + moved, controlled_mean(expected), atol=2e-5)


def test_it_passes_where_the_arm_was_left_and_begins_where_it_began():
    _, path = seen(PRIMITIVE)
    left = np.array(path.spline(1.0)) + [0.08, 0.02]
    still = DeviationDetector(np.zeros((3, 2)), np.zeros(2), 0.5, 0.1)
    correction = Correction(still, {"a": SPREAD})
    moved = correction.corrected(path, "a", [Via(1.0, left)], WIDE)
    np.testing.assert_allclose(moved.spline(1.0), left, atol=1e-3)
    np.testing.assert_allclose(moved.spline(0.0), path.spline(0.0), atol=1e-6)
    assert correction.corrected(path, "b", [Via(1.0, left)], WIDE) is path
    assert correction.corrected(path, "a", [], WIDE) is path
    vias = [Via(z, path.spline(z)) for z in (0.5, 1.0)]
    np.testing.assert_allclose(corrected_by(SPREAD, path, vias, PHASES), 0.0, atol=1e-9)


def test_a_correction_is_of_the_nearest_phase_ahead_and_takes_the_place_of_an_earlier_one():
    first, second, third = (Via(z, np.zeros(2)) for z in (0.5, 0.95, 1.0))
    assert with_via(with_via((first,), second), third) == (first, third)
    _, path = seen(PRIMITIVE)
    assert abs(phase_of(path, path.spline(0.6), 0.2) - 0.6) < 0.01
    assert phase_of(path, path.spline(0.2), 0.6) == 0.6
    assert phase_of(path, path.spline(0.5), 1.0) == 1.0


def test_the_spread_given_the_person_is_the_regression_s_with_the_start_fixed():
    n_own = PRIMITIVE.n_observed * PRIMITIVE.basis.n_basis
    inverse = np.linalg.inv(PRIMITIVE.weights.covariance)[n_own:, n_own:]
    free = Gaussian(np.zeros(len(inverse)), np.linalg.inv(inverse))  # by the precision matrix
    rows = np.kron(np.eye(2), PRIMITIVE.basis.design_matrix(np.zeros(1)))
    fixed, _ = condition(free, rows, np.zeros(2), np.zeros((2, 2)))
    np.testing.assert_allclose(SPREAD.covariance, fixed.covariance, atol=1e-9)

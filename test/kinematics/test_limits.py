# SPDX-License-Identifier: Apache-2.0
"""Joint limits."""

import dataclasses

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError, KinematicsError, ShapeError, TrajectoryError
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS, position_violation
from intent_recognition.kinematics.limits import JointLimits, check_position, within_position_limits
from intent_recognition.motion import check_range


def test_values_of_the_lwr_are_frozen_copies():
    assert np.allclose(np.degrees(LWR_LIMITS.upper), [170, 120, 170, 120, 170, 120, 170])
    assert np.array_equal(LWR_LIMITS.lower, -LWR_LIMITS.upper)
    assert LWR_LIMITS.torque.tolist() == [176, 176, 100, 100, 100, 38, 38]
    assert np.allclose(np.degrees(LWR_LIMITS.velocity), [110, 110, 128, 128, 204, 184, 184])
    lower = -np.ones(2)
    limits = JointLimits(lower, np.ones(2), np.ones(2), np.ones(2), np.ones(2))
    lower[0] = 5.0
    assert limits.lower[0] == -1.0
    with pytest.raises(ValueError, match="read-only"):
        limits.upper[0] = 3.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        limits.upper = np.ones(2)


@pytest.mark.parametrize(
    ("field", "value", "error"),
    [
        ("lower", np.full(7, 9.0), ArgumentError),
        ("upper", np.full(7, np.nan), ArgumentError),
        ("velocity", np.zeros(7), ArgumentError),
        ("torque", np.ones(6), ShapeError),
    ],
)
def test_bad_limits(field, value, error):
    with pytest.raises(error):
        dataclasses.replace(LWR_LIMITS, **{field: value})


def test_checks_and_clamping():
    q = np.zeros((3, 7))
    q[1, 3] = 2.5
    assert within_position_limits(q, LWR_LIMITS).tolist() == [True, False, True]
    clamped = np.clip(q, LWR_LIMITS.lower, LWR_LIMITS.upper)
    assert within_position_limits(clamped, LWR_LIMITS).all()
    excess = position_violation(q, LWR_LIMITS)
    assert excess[1, 3] == pytest.approx(2.5 - LWR_LIMITS.upper[3])
    assert np.count_nonzero(excess) == 1
    assert np.allclose(clamped + excess, q)
    check_position(clamped, LWR_LIMITS, JOINT_NAMES)
    with pytest.raises(KinematicsError, match=r"lwr_a4_joint.*2\.5000"):
        check_position(q, LWR_LIMITS, JOINT_NAMES)
    with pytest.raises(KinematicsError, match="finite"):
        check_position(np.full(7, np.nan), LWR_LIMITS)


def test_a_way_of_a_tenth_of_a_metre_of_a_prismatic_joint_is_tolerated_as_a_rad():
    ones = np.ones(3)
    limits = JointLimits(-ones, ones, ones, ones, ones, np.array([1.0, 0.1, 1.0]))
    differences = np.array([[0.2, 0.03, -0.1], [0.2, -0.01, -0.5]])
    np.testing.assert_allclose(limits.largest(differences), [0.3, 0.5])
    assert [limits.in_words(one) for one in differences] == ["0.03 m", "0.50 rad"]
    assert LWR_LIMITS.largest(differences[0, [0, 1, 2, 0, 0, 0, 0]]) == 0.2
    for joint, unit in enumerate(("rad", "m", "rad")):
        with pytest.raises(KinematicsError, match=rf"1\.0000\] {unit}\b.*2\.0000 {unit}\b"):
            check_position(2.0 * np.eye(3)[joint], limits)
        with pytest.raises(TrajectoryError, match=rf"1\] {unit}\b.*9 {unit}\b"):
            check_range(9.0 * np.eye(3)[[joint]], limits)
    with pytest.raises(ArgumentError, match="tolerance_scale"):
        dataclasses.replace(limits, tolerance_scale=0.0 * ones)

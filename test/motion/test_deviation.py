# SPDX-License-Identifier: Apache-2.0
"""Pushes are told from what a controller does by itself, at the rate of false alarms stated."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from intent_recognition.motion import JointReference, TrackedMotion, calibrate_detector

STEP_S = 0.01
COEFFICIENTS = np.array([[0.001, -0.002], [0.01, 0.02], [0.0005, 0.001]])


def execution(rng, n=300, std=1e-3):
    """Errors by known coefficients, and noise that lasts."""
    velocity, acceleration = rng.normal(size=(2, n, 2))
    kernel = np.ones(100) / 10.0
    noise = np.stack(
        [np.convolve(rng.normal(size=n + 99), kernel, "valid") for _ in range(2)], axis=1
    )
    b0, b1, b2 = COEFFICIENTS
    error = b0 + b1 * velocity + b2 * acceleration + std * noise
    return TrackedMotion(STEP_S, error, velocity, acceleration)


def pushed(detector, motion):
    """Whether a run of deviations lasts long enough, sample by sample."""
    lasts, n = 0, round(detector.sustained_s / STEP_S) + 1
    for error, velocity, acceleration in zip(*motion[1:], strict=True):
        reference = JointReference(np.zeros(2), velocity, acceleration)
        lasts = lasts + 1 if detector.deviates(error, reference) else 0
        if lasts >= n:
            return True
    return False


def test_coefficients_are_found_and_only_what_lasts_counts():
    rng = np.random.default_rng(0)
    detector = calibrate_detector([execution(rng, std=1e-6) for _ in range(4)], 0.4)
    np.testing.assert_allclose(detector.coefficients, COEFFICIENTS, atol=1e-5)
    rng = np.random.default_rng(2)
    detector = calibrate_detector([execution(rng, std=1e-4) for _ in range(4)], 0.4)
    still = TrackedMotion(STEP_S, *np.zeros((3, 200, 2)))
    for offset, samples, expected in ((0.03, 90, True), (0.03, 70, False), (0.006, 200, False)):
        still.error[:] = 0.0
        still.error[:samples, 1] = offset
        assert pushed(detector, still) is expected


def test_false_alarms_are_as_rare_as_stated():
    rng = np.random.default_rng(1)
    alarms, stated = 0, 0.0
    for _ in range(25):
        calibrated = [execution(rng, n=150) for _ in range(18)]
        detector = calibrate_detector(calibrated, 0.2, sustained_s=0.1, least_rad=0.0)
        alarms += sum(pushed(detector, execution(rng, n=150)) for _ in range(4))
        stated = detector.false_alarm_rate
    assert stated == 0.2
    assert 0.05 < alarms / 100 < 0.32  # of 100, 20 wanted: two standard deviations of draws in 25


def test_a_joint_that_errs_more_has_a_bound_as_much_larger_and_the_others_do_not():
    rng = np.random.default_rng(4)
    executions, scale = [execution(rng) for _ in range(6)], np.array([1.0, 20.0])
    larger = [one._replace(error=scale * one.error) for one in executions]
    before, after = (calibrate_detector(each, 0.3).explained for each in (executions, larger))
    np.testing.assert_allclose(after, scale * before, equal_nan=False)


def test_too_few_executions_for_a_rate_are_refused():
    rng = np.random.default_rng(3)
    executions = [execution(rng) for _ in range(6)]
    with pytest.raises(ArgumentError, match="6 or more"):
        calibrate_detector(executions[:5], 0.3)
    calibrate_detector(executions, 0.3)
    many = [execution(rng, n=10) for _ in range(96)]
    assert calibrate_detector(many, 1.0 / 49.0).false_alarm_rate == 1.0 / 49.0

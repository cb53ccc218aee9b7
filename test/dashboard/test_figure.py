# SPDX-License-Identifier: Apache-2.0
"""The figure's posture: the wrist is reached, bones keep their lengths, nothing jumps."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intent_recognition.dashboard.figure import (
    HIP,
    MOST_LEAN_RAD,
    SHOULDER,
    SHOULDER_HALF_WIDTH,
    Stance,
    bend,
    bone_axes,
    lean_toward,
    reach,
)

STANCES = [
    Stance(np.array([1.4, 0.1, -0.85]), np.pi, left=False),
    Stance(np.array([0.2, -0.5, 0.0]), 0.4, 1.6, left=True),
]
stances = pytest.mark.parametrize("stance", STANCES, ids=["right", "left"])


def wrists(stance, count=300, spread_m=0.8):
    """Points all around the shoulder, near and far beyond the arm's reach."""
    middle = stance.ground_m + [0.0, 0.0, 0.7 * stance.height_m]
    return middle + spread_m * np.random.default_rng(5).normal(size=(count, 3))


@stances
def test_the_wrist_is_reached_and_bones_keep_their_lengths(stance):
    upper, fore = stance.arm_m
    for wrist in wrists(stance):
        posture = reach(stance, wrist)
        np.testing.assert_array_equal(posture.wrist, wrist)
        lengths = [np.linalg.norm(posture.elbow - at) for at in (posture.shoulder, wrist)]
        np.testing.assert_allclose(lengths, [upper, fore], atol=1e-12)
        own = posture.upper_body.T @ (posture.shoulder - posture.hip)
        across = stance.side * SHOULDER_HALF_WIDTH * stance.height_m
        np.testing.assert_allclose(
            own, [0.0, across, (SHOULDER - HIP) * stance.height_m], atol=1e-12
        )
        np.testing.assert_allclose(
            posture.hip - posture.moved, stance.ground_m + [0, 0, HIP * stance.height_m]
        )


@stances
def test_the_posture_changes_no_more_than_the_wrist_does(stance):
    """Along random straight ways a step that is a tenth as long changes a tenth as much."""
    rng = np.random.default_rng(6)
    for wrist in wrists(stance, 40, 0.5):
        step = rng.normal(size=3)
        step *= 1e-5 / np.linalg.norm(step)
        before = np.concatenate([np.ravel(part) for part in reach(stance, wrist)])
        after = np.concatenate([np.ravel(part) for part in reach(stance, wrist + step)])
        assert np.abs(after - before).max() < 1e-3


def test_within_reach_nobody_leans_and_nobody_is_moved():
    stance = STANCES[0]
    posture = reach(stance, np.array([1.1, 0.3, 0.27]))
    np.testing.assert_array_equal(posture.moved, np.zeros(3))
    np.testing.assert_allclose(posture.upper_body, stance.rotation, atol=1e-15)


def test_a_little_out_of_reach_he_leans_as_little_as_is_needed():
    stance = STANCES[0]
    posture = reach(stance, np.array([0.75, 0.3, 0.3]))
    np.testing.assert_allclose(posture.moved, np.zeros(3), atol=1e-12)
    lean = np.arccos((np.trace(posture.upper_body @ stance.rotation.T) - 1.0) / 2.0)
    assert 0.01 < lean < MOST_LEAN_RAD
    reached = np.linalg.norm(posture.wrist - posture.shoulder)
    assert reached == pytest.approx(0.98 * sum(stance.arm_m))


def test_the_smallest_rotation_is_the_one_found_by_search():
    arm, target, wanted = np.array([0.1, 0.2, 0.5]), np.array([0.7, -0.1, 0.4]), 0.45
    lean = lean_toward(arm, target, wanted)
    axis = np.cross(arm, target) / np.linalg.norm(np.cross(arm, target))
    angles = np.linspace(0.0, 1.5, 15_001)
    ends = Rotation.from_rotvec(angles[:, None] * axis).apply(arm)
    first = angles[np.argmax(np.linalg.norm(ends - target, axis=1) <= wanted)]
    assert np.arccos((np.trace(lean) - 1) / 2) == pytest.approx(first, abs=2e-4)


def test_the_elbow_lies_on_the_side_of_its_pole():
    elbow = bend(np.zeros(3), np.array([0.4, 0.0, 0.0]), 0.3, 0.25, np.array([0.5, 0.0, -1.0]))
    assert elbow[1] == 0.0
    assert elbow[2] < 0.0


def test_axes_of_a_bone_are_a_rotation_along_it():
    axes = bone_axes(np.array([0.3, -0.2, 0.1]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(np.cross(axes[:, 2], [0.3, -0.2, 0.1]), 0.0, atol=1e-15)

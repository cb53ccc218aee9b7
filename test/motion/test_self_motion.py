# SPDX-License-Identifier: Apache-2.0
"""A redundant arm whose end would touch turns about its hand; the hand keeps to the prediction."""

import numpy as np
import pytest
from activation_world import LIMITS
from clearance_world import ARM, PATH, POSITIONS, TIMES, bodies_among, clearance, primitive
from scipy.spatial.transform import Rotation

from intent_recognition.kinematics import Box
from intent_recognition.motion import ClearPath, Obstruction, Spread, make_path
from intent_recognition.motion.self_motion import HandKept, Turn

PHASES = np.linspace(0.0, 1.0, 201)
END = PATH.spline(1.0)
JOINTS_M = ARM.skeleton(END[None])[0]
OF_HAND = {"plate": Spread.of(primitive(3), ARM)}


def post(joint, *offset_m):
    """A box beside a joint of the arm at the end of the path."""
    return Box("post", tuple(JOINTS_M[joint] + offset_m), (0.06,) * 3)


POSTS = [post(3, 0, 0.12, 0), post(3, 0, -0.12, 0), post(5, 0, 0.1, 0), post(5, -0.16, 0, 0)]


def hands_m(path):
    return ARM.forward_kinematics(path.spline(PHASES))[:, :3, 3]


@pytest.mark.parametrize("box", POSTS)
def test_an_end_that_touches_is_reached_in_another_posture(box):
    bodies = bodies_among(box)
    assert bodies.contacts(END[None]) and not bodies.contacts(PATH.spline(0.0)[None])
    found = clearance(box, spreads=OF_HAND).clear(PATH, "plate", 0.0, LIMITS)
    assert isinstance(found, ClearPath) and found.how == "replanned"
    assert not bodies.contacts(found.path.spline(PHASES))
    np.testing.assert_allclose(found.path.spline(0.0), PATH.spline(0.0), atol=1e-9)
    np.testing.assert_allclose(hands_m(found.path)[-1], hands_m(PATH)[-1], atol=1e-4)


def test_an_end_stays_where_it_is_clear_enclosed_or_nothing_is_planned_anew():
    for guard in (clearance(POSTS[0]), clearance(POSTS[0], spreads=OF_HAND, replan_budget_s=0.0)):
        assert isinstance(guard.clear(PATH, "plate", 0.0, LIMITS, tries=0), Obstruction)
    kept = HandKept(ARM, False, LIMITS)
    assert kept.clear_end(bodies_among(post(5, 0.6, 0.0, 0.6)), END) is None
    cage = [post(6, *offset) for offset in 0.1 * np.vstack([np.eye(3), -np.eye(3)])]
    assert kept.clear_end(bodies_among(*cage), END) is None


def test_the_hand_keeps_to_the_path_while_the_arm_turns():
    kept = HandKept(ARM, False, LIMITS)
    end = kept.clear_end(bodies_among(POSTS[0]), END)
    turned = kept.turned(PATH, Turn(0.3, end - END))
    np.testing.assert_allclose(hands_m(turned), hands_m(PATH), atol=1e-3)
    before = PHASES <= 0.3
    np.testing.assert_allclose(
        turned.spline(PHASES[before]), PATH.spline(PHASES[before]), atol=2e-3
    )
    np.testing.assert_allclose(turned.spline(1.0), end, atol=1e-6)


def test_a_whole_pose_stays_where_it_is_taught():
    reference = Rotation.from_matrix(ARM.forward_kinematics(END)[:3, :3]).as_quat()
    spreads = {"plate": Spread.of(primitive(6), ARM, tuple(reference))}
    found = clearance(POSTS[0], spreads=spreads).clear(PATH, "plate", 0.0, LIMITS)
    assert isinstance(found, ClearPath)
    np.testing.assert_allclose(
        ARM.forward_kinematics(found.path.spline(1.0)), ARM.forward_kinematics(END), atol=1e-4
    )


def test_the_next_prediction_goes_on_turned_with_its_own_hand():
    guard = clearance(POSTS[0], spreads=OF_HAND)
    first = guard.clear(PATH, "plate", 0.0, LIMITS)
    positions = POSITIONS + 0.02 * np.sin(np.pi * TIMES / 2.0)[:, None] ** 2
    newer = make_path(TIMES, positions + 0.01 * TIMES[:, None], LIMITS)
    found = guard.clear(newer, "plate", 0.2, LIMITS, before=first)
    assert not bodies_among(POSTS[0]).contacts(found.path.spline(PHASES))
    np.testing.assert_allclose(hands_m(found.path)[-1], hands_m(newer)[-1], atol=1e-4)
    away = found.path.spline(PHASES) - newer.spline(PHASES)
    same = first.path.spline(PHASES) - PATH.spline(PHASES)
    np.testing.assert_allclose(away, same, atol=0.1)
    beyond = ClearPath(PATH, turn=Turn(0.2, np.full(7, 3.0)))
    assert clearance(spreads=OF_HAND).clear(newer, "plate", 0.2, LIMITS, beyond).path is newer

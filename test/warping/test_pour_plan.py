# SPDX-License-Identifier: Apache-2.0
"""A pour given the containers and where they stand: identities of conditioning and of poses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError, ModelError
from intent_recognition.model import load_pouring_skill, save_pouring_skill
from intent_recognition.promp import ContextModel, NormalizedRBFBasis
from intent_recognition.warping import (
    Emptying,
    PouringSkill,
    Reached,
    References,
    SeenContainer,
    WarpedPrimitive,
    from_warped,
    plan_pour,
)
from intent_recognition.warping.pour_plan import conditioned

CUP, SECOND = References(0.04, 3e-4, 0.09, 0.8), References(0.06, 5e-4, 0.07, 0.6)
PHASE = np.linspace(0.0, 1.0, 81)
HOLDS = Emptying(np.linspace(0.0, 1.5, 31), np.linspace(1.0, 0.0, 31), 1.5)


@pytest.fixture(scope="module")
def skill():
    """Ten pours that come from the left, tilt above the opening and go back."""
    rng, over = np.random.default_rng(2), np.sin(np.pi * PHASE)[:, None] ** 2
    start, above = np.array([-3.0, 0.0, 0.8, 0.0]), np.array([-0.6, 0.0, 0.3, 2.4])
    paths = [
        start + over * (above - start + 0.05 * rng.standard_normal(4)) + 0.05 * rng.normal(size=4)
        for _ in range(10)
    ]
    primitive = WarpedPrimitive.learn(paths, [8.0] * 10, NormalizedRBFBasis(25))
    return PouringSkill(primitive, Reached(1.0, 2.4, 0.3))


def standing(lip=(0.5, -0.2, 0.4), tilt=0.0):
    """A cup with its lip toward +y, and the second container; the hand is behind the cup."""
    lip, up = np.array(lip), np.array([0.0, np.sin(tilt), np.cos(tilt)])
    cup = SeenContainer(CUP, lip - [0.0, 0.04, 0.0], lip, up, HOLDS)
    opening = np.array([0.5, 0.1, 0.3])
    hand = np.eye(4)
    hand[:3, :3] = Rotation.from_rotvec([0.3, 1.2, -0.4]).as_matrix()
    hand[:3, 3] = lip - [0.15, 0.05, 0.05]
    return cup, SeenContainer(SECOND, opening, opening, np.array([0.0, 0.0, 1.0]), HOLDS), hand


def test_the_references_are_a_context_with_a_known_gain(skill):
    """Mean: that of a `ContextModel` whose gain is the warped weights."""
    n, scaled = 25, skill.primitive.mean.reshape(4, 25)
    gain = np.zeros((4, n, 3))
    for dof, context in enumerate((0, 0, 1, 2)):
        gain[dof, :, context] = scaled[dof]
    other = np.array([0.08, 0.12, 0.9])  # radius of the second, height and tilt of the cup
    parts = (other[None], np.eye(3)[None], gain.reshape(1, 4 * n, 3), np.array([9.0]), (3,))
    model = ContextModel(("radius", "height", "tilt"), ("m", "m", "rad"), *parts)
    there = gain.reshape(-1, 3) @ other
    shift, _, _ = model.given(np.array([0.06, 0.09, 0.8]))
    here = there + shift[0]
    given = skill.primitive.given(CUP, SECOND)
    np.testing.assert_allclose(given.weights.mean, here, atol=1e-12)
    found = given.predict_controlled(len(PHASE))
    expected = from_warped(skill.primitive.mean_path(PHASE), CUP, SECOND)
    np.testing.assert_allclose(found.positions, np.column_stack(expected), atol=1e-12)


def test_a_pour_begins_and_ends_where_the_cup_is_and_pours_as_learned(skill):
    cup, second, _ = standing(lip=(0.55, -0.35, 0.5))
    found = conditioned(skill, cup, second).predict_controlled(len(PHASE))
    stand = [-0.45, -0.05, 0.2, 0.0]
    np.testing.assert_allclose(found.positions[[0, -1]], [stand, stand], atol=1e-6)
    np.testing.assert_allclose(found.velocities[[0, -1]], np.zeros((2, 4)), atol=1e-5)
    assert np.all(found.std[[0, -1]] < 1e-3)
    learned, _ = from_warped(skill.primitive.mean_path(PHASE), CUP, SECOND)
    above = np.hypot(*learned[:, :2].T) < 0.9 * SECOND.opening_radius_m
    assert above.sum() > 10
    np.testing.assert_allclose(found.positions[above, :3], learned[above], atol=0.01)


def test_a_plan_turns_and_moves_with_the_scene(skill):
    """A quarter turn about the vertical and a shift of everything turn and shift the plan."""
    cup, second, hand = standing()
    plan = plan_pour(skill, cup, second, hand, "50", 0.5)
    move = np.eye(4)
    move[:3, :3] = Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0]).as_matrix()
    move[:3, 3] = [0.2, -0.1, 0.3]

    def moved(one):
        there = (move[:3, :3] @ point + move[:3, 3] for point in (one.opening_m, one.lip_m))
        opening, lip = there
        return one._replace(opening_m=opening, lip_m=lip, up=move[:3, :3] @ one.up)

    other = plan_pour(skill, moved(cup), moved(second), move @ hand, "50", 0.5)
    np.testing.assert_allclose(other.hand_poses, move @ plan.hand_poses, atol=1e-9)


def test_the_hand_turns_about_the_lip_by_as_much_as_is_asked_for(skill):
    cup, second, hand = standing()
    plan = plan_pour(skill, cup, second, hand, "60", 0.5)
    np.testing.assert_allclose(plan.hand_poses[[0, -1]], [hand, hand], atol=1e-5)
    assert plan.left == pytest.approx(0.3)
    lip_in_hand = np.linalg.inv(hand) @ np.append(cup.lip_m, 1.0)
    upright = np.linalg.inv(hand[:3, :3]) @ cup.up
    turned = plan.hand_poses[:, :3, :3] @ upright
    most = np.argmin(turned[:, 2])
    tilt = np.arctan2(turned[most, 1], turned[most, 2])  # toward +y, where the lip is
    assert tilt == pytest.approx(HOLDS.tilt_leaving(0.3), abs=0.02)
    lip = plan.hand_poses @ lip_in_hand
    assert abs(lip[most, 2] - second.opening_m[2] - 0.3 * CUP.height_m) < 0.01
    turns, reach = plan.hand_std[:, 3:, 3], plan.hand_poses[:, :3, 3] - lip[:, :3]
    np.testing.assert_allclose(plan.hand_std[:, :3, 3], np.cross(turns, reach), atol=1e-9)
    assert np.linalg.norm(turns[most]) > 0.01  # also of what it does not know


def test_a_tilted_cup_is_refused(skill):
    with pytest.raises(ArgumentError, match="tilted by 29 degrees"):
        plan_pour(skill, *standing(tilt=0.5), "empty", 0.5)


def test_a_skill_survives_its_file(skill, tmp_path):
    path = save_pouring_skill(tmp_path / "new" / "skill.npz", skill)
    read = load_pouring_skill(path)
    assert read.far == skill.far
    np.testing.assert_array_equal(read.primitive.spread, skill.primitive.spread)
    np.testing.assert_array_equal(read.primitive.mean_path(PHASE), skill.primitive.mean_path(PHASE))


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("format_version", np.array(9), "format_version"),
        ("mean", np.zeros(7), r"mean: expected shape \(100,\), got \(7,\)"),
        ("spread", np.full((100, 10), np.nan), "spread: expected finite numbers, got NaN"),
        ("reached", np.zeros(2), r"reached: expected shape \(3,\), got \(2,\)"),
        ("duration_s", None, "duration_s: expected an array, got none. Write it again"),
        ("spread", None, "spread: expected an array"),
        ("basis", np.array(["a", "b"]), "basis: expected real numbers, got type"),
    ],
)
def test_a_bad_file_is_named(skill, tmp_path, name, value, reason):
    path = save_pouring_skill(tmp_path / "skill.npz", skill)
    with np.load(path) as content:
        arrays = dict(content)
    arrays.pop(name) if value is None else arrays.update({name: value})
    np.savez(path, **arrays)
    with pytest.raises(ModelError, match=reason):
        load_pouring_skill(path)

# SPDX-License-Identifier: Apache-2.0
"""Pouring: quick pours count balls as the arm's physics does, and cups touch where they meet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from intent_recognition.errors import ArgumentError, BagError
from intent_recognition.improvement import load_cost
from intent_recognition.kinematics.inverse import inverse_kinematics
from intent_recognition.model import load_pouring_skill
from intent_recognition.share import share_path
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.balls.collision import HULL_MARGIN_M, N_CORNERS, shell_pieces, solid_pieces
from sim_bridge.containers.generate import CONTAINER_NAMES, make_container
from sim_bridge.scenarios.pouring import PouringPractice, read_demonstrated, read_pour, seen_as
from sim_bridge.scenarios.pouring.ball_pour import BallPours
from sim_bridge.scenarios.pouring.novel import container_named, half_full_radius_m
from sim_bridge.scenarios.pouring.table import PouringTable
from sim_bridge.scenarios.pouring.task_space import OPENING_M, SEED_POSTURE, PourPath, SideGrasp


@pytest.fixture(scope="module")
def skill(pouring_skill):
    return load_pouring_skill(pouring_skill)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "spilled", "kept"),
    [("tea_cup_paper_cup_mean", (0, 0), (8, 10)), ("tea_cup_paper_cup_75", (0, 0), (5, 8))],
)
def test_quick_pours_end_as_those_that_the_arm_made(name, spilled, kept):
    path, labels = read_pour(share_path(f"bags/pouring/executed/{name}"))
    cup, second = (container_named(labels[key]) for key in ("cup", "second"))
    with BallPours(cup, second, half_full_radius_m(cup), 40) as pours:
        count = pours.pour(path, 0)
        assert pours.pour(path, 0) == count
    assert count.balls == 40 == count.caught + count.spilled + count.kept
    assert spilled[0] <= count.spilled <= spilled[1]
    assert kept[0] <= count.kept <= kept[1]


@pytest.mark.slow
def test_a_rollout_is_logged_as_the_pour_it_was(skill, tmp_path):
    with PouringPractice(skill, "mug", "tumbler", wanted=30) as practice:
        space = practice.space
        assert practice.keeps_limits(space.mean)
        assert not practice.keeps_limits(space.mean + 50.0)  # radii away: out of reach
        weights = space.weights(space.within(np.full(space.n_axes, 0.3)))
        (rollout,) = practice.rollout(weights, np.random.default_rng(1))
        assert load_cost("level")(rollout) == abs(30.0 - rollout.outcome["caught"])
        practice.write(tmp_path / "000", [rollout], {"rollout": "0"})
        path, labels = read_pour(tmp_path / "000")
        assert (labels["task"], labels["caught"]) == ("pouring", f"{rollout.outcome['caught']:g}")
        wanted = practice.path(weights)
    hasty = skill._replace(primitive=replace(skill.primitive, duration_s=0.5))
    with PouringPractice(hasty, "mug", "tumbler") as practice:
        assert not practice.keeps_limits(space.mean)
    for axis in range(3):
        there = np.interp(path.times_s, wanted.times_s, wanted.offset_m[:, axis])
        np.testing.assert_allclose(path.offset_m[:, axis], there, atol=0.003)


def test_practice_pours_to_the_level_that_is_asked_for(skill):
    """As the graph does: what is left decides how far the cup is tilted."""
    cup = seen_as("tea_cup", 1).emptying
    for wanted, largest in ((40, cup.empty_rad + skill.far.beyond_rad), (10, None)):
        with PouringPractice(skill, "tea_cup", "paper_cup", wanted) as practice:
            path = practice.path(practice.space.mean)
            weights = practice.space.mean * 1.02
            further = practice.path(weights).tilt_rad.max()
        largest = largest or cup.tilt_leaving(0.5 * 0.75)
        assert path.tilt_rad.max() == pytest.approx(largest, abs=1e-3)
        assert further == pytest.approx(1.02 * largest, abs=2e-3)


@pytest.mark.slow
def test_a_small_container_overflows():
    """As in the arm's physics, where 21 of 40 balls stay in the espresso cup."""
    path, _ = read_pour(share_path("bags/pouring/executed/mug_tumbler_mean"))
    cup, small = container_named("tumbler"), container_named("espresso_cup")
    with BallPours(cup, small, half_full_radius_m(cup), 40) as pours:
        assert pours.pour(path, 0).caught <= 20


def test_what_cannot_be_practised_is_said_before_anything_is_poured(skill, tmp_path):
    for cup, second, wanted in (("cup", "mug", 1), ("mug", "cup", 1), ("mug", "espresso_cup", 40)):
        with pytest.raises(ArgumentError):
            PouringPractice(skill, cup, second, wanted)
    with pytest.raises(BagError, match="recorded pours"):
        read_demonstrated(tmp_path)


@pytest.mark.parametrize("name", CONTAINER_NAMES)
def test_pieces_are_the_container_less_the_margin_and_its_shell_a_wall_thick(name):
    container = make_container(name)
    filled = sum(ConvexHull(piece).volume for piece in solid_pieces(container))
    truth = container.inner_volume_m3 + container.mesh.volume
    assert 0.88 < filled / truth < 1.0
    for pieces in (solid_pieces(container), shell_pieces(container)):
        corners = np.concatenate(pieces)
        low, high = container.mesh.bounds
        assert np.all(corners > low + 0.5 * HULL_MARGIN_M)
        assert np.all(corners < high - 0.5 * HULL_MARGIN_M)
    sections = container.sections
    for piece in shell_pieces(container)[1 : 1 + N_CORNERS]:
        at = np.interp(piece[:, 2], sections.heights_m, np.arange(len(sections.heights_m)))
        narrowest = np.linalg.norm(sections.inner[np.floor(at).astype(int)], axis=2).min(1)
        assert np.all(np.linalg.norm(piece[:, :2], axis=1) > 0.97 * narrowest)
        assert ConvexHull(piece).volume > 0.0


@pytest.mark.slow
def test_a_cup_pushed_against_the_other_stops_where_they_meet():
    cup, second = make_container("espresso_cup", 1), make_container("tumbler", 1)
    grasp, below = SideGrasp(cup.lip_point, cup.height_m), 0.02
    gap = np.array([0.012, -0.015])
    sections, height = second.sections, second.height_m - below
    outer = np.interp(height, sections.heights_m, np.linalg.norm(sections.outer[:, 0], axis=1))
    widest = np.linalg.norm(cup.sections.outer[:, 0], axis=1).max()
    meets = outer + widest - cup.opening_radius_m
    ends = PourPath(
        np.arange(2.0), np.column_stack([-meets - gap, [0.0, 0.0], [-below, -below]]), np.zeros(2)
    )
    first, last = (
        inverse_kinematics(pose, SEED_POSTURE) for pose in grasp.hand_poses(ends, OPENING_M)
    )
    with SimulatedArm(first) as arm:
        table = PouringTable(arm, cup, second, 0.006, 3, np.random.default_rng(0))
        assert table.touch_n() == 0.0
        for share in np.linspace(0.0, 1.0, 60):
            arm.set_reference(first + share * (last - first))
            arm.step(10)
        arm.step(300)
        pose = table.cup_pose()
        lip = pose[:3, :3] @ cup.lip_point + pose[:3, 3] - OPENING_M
        assert 0.5 < table.touch_n() < 30.0
        assert lip[1] == pytest.approx(-meets, abs=0.002)
        in_cup, _ = table.look()
        assert in_cup.all()
        assert table.through_wall == 0

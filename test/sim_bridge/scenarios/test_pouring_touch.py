# SPDX-License-Identifier: Apache-2.0
"""A cup touches the container it pours into, where their true outsides meet."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from intent_recognition.kinematics.inverse import inverse_kinematics
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.balls.collision import HULL_MARGIN_M, N_CORNERS, shell_pieces, solid_pieces
from sim_bridge.containers.generate import CONTAINER_NAMES, make_container
from sim_bridge.scenarios.pouring.table import PouringTable
from sim_bridge.scenarios.pouring.task_space import OPENING_M, SEED_POSTURE, PourPath, SideGrasp


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
    container = make_container(name)
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

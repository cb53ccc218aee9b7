# SPDX-License-Identifier: Apache-2.0
"""Pours with pairs never demonstrated: plans, their check, and the shipped recordings."""

import numpy as np
import pytest

from experiments.pouring.executed import (
    MEAN,
    UNWARPED,
    PourOrder,
    asked_level,
    learn_skill,
    planned,
)
from intent_recognition.kinematics.lwr import forward_kinematics
from intent_recognition.share import share_path
from intent_recognition.warping import EMPTY
from sim_bridge.containers.generate import make_container
from sim_bridge.scenarios.pouring import PAIRS, container_named, plan, read_pour, seen_as
from sim_bridge.scenarios.pouring.task_space import OPENING_M, PourPath, SideGrasp, plan_joints

SEED = 1


@pytest.fixture(scope="module")
def skill():
    return learn_skill(share_path("bags/pouring/train"), SEED)


@pytest.mark.slow
def test_the_demonstrated_pair_is_poured_and_emptied_as_it_was_demonstrated(skill):
    path = plan(skill.primitive, skill.cup.references, skill.second.references)
    unwarped = planned(PourOrder(SEED, 1, UNWARPED), skill).path
    np.testing.assert_array_equal(path.offset_m, unwarped.offset_m)
    np.testing.assert_array_equal(path.tilt_rad, unwarped.tilt_rad)
    path = plan(skill.primitive, skill.cup.references, skill.second.references)
    level = asked_level(skill.far, EMPTY, skill.cup, skill.second.references)
    to_level = plan(skill.primitive, skill.cup.references, skill.second.references, level=level)
    np.testing.assert_array_equal(to_level.offset_m, path.offset_m)
    np.testing.assert_allclose(to_level.tilt_rad, np.maximum(path.tilt_rad, 0.0), atol=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("pair", "pour"), [(6, "50"), (8, "70")])
def test_what_was_asked_for_was_left(skill, pair, pour):
    """Within a tenth of the cup's volume, and along the path that is planned now."""
    order = PourOrder(SEED, pair, MEAN, pour)
    plan_, (path, labels) = planned(order, skill), read_pour(share_path(f"bags/{order.folder}"))
    asked = np.interp(path.times_s, plan_.path.times_s, plan_.path.tilt_rad)
    assert np.degrees(np.abs(path.tilt_rad - asked).max()) < 6.0
    wanted = 80.0 * plan_.left_m3 / plan_.cup.references.volume_m3
    assert 20.0 < wanted < 32.0
    assert abs(int(labels["kept"]) - wanted) <= 8.0
    assert int(labels["spilled"]) == 0


def test_plans_scale_with_scans_and_are_risky_beside_the_opening(skill):
    path = planned(PourOrder(SEED, 2, MEAN), skill).path
    cup, second = (seen_as(name, SEED).references for name in PAIRS[2])
    demonstrated = plan(skill.primitive, skill.cup.references, skill.second.references)
    wide = second.opening_radius_m / skill.second.references.opening_radius_m
    np.testing.assert_allclose(path.offset_m[:, :2], wide * demonstrated.offset_m[:, :2])
    steep = cup.tilt_rad / skill.cup.references.tilt_rad
    np.testing.assert_allclose(path.tilt_rad, steep * demonstrated.tilt_rad)
    cup, second = skill.cup.references, skill.second.references
    times = np.linspace(0.0, 2.0, 41)
    offset = np.tile([-3.0 * second.opening_radius_m, 0.0, 0.05], (41, 1))
    tilted = PourPath(times, offset, 2.5 * cup.tilt_rad * times / 2.0)
    assert skill.constraints.risk(tilted, cup, second).max() > 0.9
    upright = PourPath(times, offset, np.zeros(41))
    assert skill.constraints.risk(upright, cup, second).max() < 0.01


@pytest.mark.slow
def test_scans_tell_reference_values():
    for name in {name for pair in PAIRS for name in pair}:
        true, seen = container_named(name), seen_as(name, SEED).references
        assert abs(seen.opening_radius_m / true.opening_radius_m - 1.0) < 0.02
        assert abs(seen.tilt_rad - true.tilt_reference_rad) < np.deg2rad(2.0)


def test_a_believed_opening_moves_the_hand_along():
    cup = make_container("mug")
    times = np.linspace(0.0, 1.0, 21)
    path = PourPath(times, np.tile([-0.03, 0.0, 0.04], (21, 1)), np.zeros(21))
    grasp, off = SideGrasp(cup.lip_point, cup.height_m), np.array([0.01, -0.02, 0.005])
    here, there = (
        forward_kinematics(plan_joints(path, grasp, opening)(0.5))[:3, 3]
        for opening in (OPENING_M, OPENING_M + off)
    )
    np.testing.assert_allclose(there - here, off, atol=2e-5)


@pytest.mark.parametrize("pair", [1, 4])
def test_the_arm_recorded_what_was_planned(skill, pair):
    order = PourOrder(SEED, pair, MEAN)
    plan_, (path, labels) = (planned(order, skill), read_pour(share_path(f"bags/{order.folder}")))
    assert int(labels["balls"]) == 40
    assert float(labels["risk"]) == pytest.approx(plan_.risk, abs=0.05)
    asked = np.interp(path.times_s, plan_.path.times_s, plan_.path.tilt_rad)
    assert np.degrees(np.abs(path.tilt_rad - asked).max()) < 6.0
    for axis in range(3):
        asked = np.interp(path.times_s, plan_.path.times_s, plan_.path.offset_m[:, axis])
        assert np.abs(path.offset_m[:, axis] - asked).max() < 0.012

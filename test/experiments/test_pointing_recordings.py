# SPDX-License-Identifier: Apache-2.0
"""Pointing: geometry, the lesson in physics, the execution, and the experiment on a subset."""

import json
from functools import cache

import numpy as np
import pytest
from simulation import gathered

from experiments.pointing.execution import execute
from experiments.pointing.experiment import run
from experiments.pointing.finger import PointingBodies
from experiments.pointing.recordings import PointingOrder, orders, record
from experiments.pointing.scene import (
    CIRCLE_CENTRE_M,
    CIRCLE_DIAMETER_M,
    FINGER_LENGTH_M,
    HOME,
    SPOTS_M,
    TABLE_HEIGHT_M,
    TIP_ABOVE_TABLE_M,
    arm_posture,
    home_pose,
    pointed_at,
    pointing_pose,
    spot,
)
from experiments.pointing.study import condition_on_end
from experiments.recording import POSITION_STEP_M, to_counts
from experiments.settings import Settings
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.errors import ArgumentError
from intent_recognition.gaussian.normal import Gaussian, marginal, regression
from intent_recognition.kinematics.inverse import branch_of
from intent_recognition.kinematics.lwr import LWR_LIMITS, forward_kinematics
from intent_recognition.learning import TrainingSettings
from sim_bridge.arm.arm import SimulatedArm
from sim_bridge.scenarios.toolbox.scene import ARM_BRANCH

record_once = cache(record)
EVERY = [(purpose, k) for purpose in SPOTS_M for k in range(9)]


@pytest.mark.parametrize(("purpose", "k"), EVERY)
def test_the_finger_points_at_each_spot_with_its_tip_just_above(purpose, k):
    target = spot(purpose, k)
    q = arm_posture(pointing_pose(target))
    np.testing.assert_allclose(pointed_at(q), target, atol=1e-9)
    hand = forward_kinematics(q)
    tip = hand[:3, 3] + FINGER_LENGTH_M * hand[:3, 2]
    assert tip[2] - TABLE_HEIGHT_M == pytest.approx(TIP_ABOVE_TABLE_M, abs=1e-9)
    assert branch_of(q) == ARM_BRANCH
    assert np.min(LWR_LIMITS.upper - np.abs(q)) > np.radians(8.0)


def test_the_spots_fill_the_circle_and_no_test_spot_was_demonstrated():
    for spots in SPOTS_M.values():
        assert np.linalg.norm(spots - CIRCLE_CENTRE_M, axis=1).max() <= 0.5 * CIRCLE_DIAMETER_M
    apart = np.linalg.norm(SPOTS_M["train"][:, None] - SPOTS_M["test"], axis=2)
    assert apart.min() > 0.02
    with pytest.raises(ArgumentError, match="index"):
        spot("train", 9)
    with pytest.raises(ArgumentError, match="finger"):
        pointed_at(arm_posture(home_pose() @ np.diag([-1.0, 1.0, -1.0, 1.0])))


@pytest.mark.slow
def test_the_arm_is_led_to_the_spot_without_touching_the_table():
    shown = record_once(PointingOrder(1, "train", 4))
    arm = shown.arm
    assert np.abs(arm.positions_rad[0] - HOME).max() < 0.03
    assert np.linalg.norm(arm.pointed_m - shown.spot_m) < 0.03
    assert 1.0 < arm.strongest_pull_n < 40.0
    assert not arm.touched
    started = np.abs(arm.positions_rad - arm.positions_rad[0]).max(axis=1) > 0.05
    assert np.argmax(started) * 0.01 > shown.person.end_s
    assert np.all(np.abs(arm.velocities_rad_s) < LWR_LIMITS.velocity)


def test_the_arm_ends_where_a_trajectory_says_and_a_low_finger_is_noticed():
    goal = arm_posture(pointing_pose(spot("test", 7)))
    times = np.linspace(0.0, 1.5, 20)
    tau = times / times[-1]
    share = tau**3 * (10 - 15 * tau + 6 * tau**2)
    speed = np.gradient(share, times)
    run = execute(times, HOME + share[:, None] * (goal - HOME), speed[:, None] * (goal - HOME))
    assert np.linalg.norm(run.pointed_m - spot("test", 7)) < 0.002
    assert run.largest_lag_rad < 0.02
    assert not run.touched
    low = pointing_pose(spot("train", 0))
    low[2, 3] -= TIP_ABOVE_TABLE_M + 0.005
    with SimulatedArm(arm_posture(low)) as arm:
        bodies = PointingBodies(arm)
        arm.step(3)
        assert bodies.touches()


def test_what_is_shipped_is_listed_and_what_the_generator_makes(repository):
    bag = repository / "bags/pointing/test/pointing_00"
    (shipped,), _ = read_demonstrations([bag], load_dofs())
    samples = record_once(PointingOrder(1, "test", 0)).person.samples
    made = to_counts(samples.positions_m[samples.visible], POSITION_STEP_M)
    np.testing.assert_array_equal(shipped.observed[0].values, made)
    folder = repository / "bags" / "pointing"
    assert {o.folder for o in orders(1)} == {
        path.relative_to(folder.parent) for path in folder.glob("*/*")
    }
    found, rejections = read_demonstrations([folder], load_dofs())
    assert len(found) == 18
    assert not rejections


@pytest.mark.slow
def test_the_arm_points_within_the_circle_tenth_as_was_predicted(shipped_again):
    numbers = run(Settings(quick=True)).numbers
    assert len(numbers["error_m"]) == 2
    assert numbers["largest_error_m"] == max(numbers["error_m"]) < 0.03
    assert numbers["mean_error_m"] < np.mean(numbers["nearest_demonstration_error_m"])
    assert not any(numbers["touched_table"])
    assert numbers["largest_execution_error_m"] < 0.002
    json.dumps(dict(numbers))


@pytest.mark.slow
def test_conditioning_on_the_end_is_the_joint_gaussian_of_end_and_weights(repository):
    bags = sorted((repository / "bags" / "pointing" / "train").iterdir())[:4]
    library = gathered(read_demonstrations(bags, load_dofs())[0], TrainingSettings()).library
    primitive, n_basis = library.primitive(0).weights, library.basis.n_basis
    wrist = np.array([0.9, 0.02, 0.03])
    row = library.basis.design_matrix(np.ones(1))[0]
    matrix = np.zeros((3, len(primitive.mean)))
    for k in range(3):
        matrix[k, k * n_basis : (k + 1) * n_basis] = row
    noise = np.diag(library.noise_variance[:3] * library.noise_scale)
    cross = matrix @ primitive.covariance
    joint = Gaussian(
        np.concatenate((matrix @ primitive.mean, primitive.mean)),
        np.block([[cross @ matrix.T + noise, cross], [cross.T, primitive.covariance]]),
    )
    rule = regression(joint, 3)
    posterior = condition_on_end(library, wrist)
    np.testing.assert_allclose(posterior.mean, rule.matrix @ wrist + rule.offset, atol=1e-8)
    np.testing.assert_allclose(posterior.covariance, rule.covariance, atol=1e-9)
    spread = np.diag(marginal(primitive, np.arange(5)).covariance)
    assert np.all(np.diag(posterior.covariance)[:5] <= spread + 1e-12)

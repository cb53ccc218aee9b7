# SPDX-License-Identifier: Apache-2.0
"""What the simulated arm does when held, pushed, guided, loaded and moved."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError, KinematicsError, ShapeError
from intent_recognition.kinematics.lwr import LWR_LIMITS, jacobian
from sim_bridge.arm.arm import SensorNoise, SimulatedArm
from sim_bridge.arm.controllers import ControllerGains
from sim_bridge.arm.robots import READY_POSITION


@pytest.fixture(scope="module")
def world():
    with SimulatedArm() as made:
        yield made


@pytest.fixture
def arm(world):
    world.before_step.clear()
    world.set_gravity_compensation(False)
    world.set_payload(0.0)
    world.reset()
    return world


def displacement_mm(arm, start):
    return 1000.0 * float(np.linalg.norm(arm.hand_pose().position - start))


@pytest.mark.parametrize(("force_n", "least_mm", "most_mm"), [(10.0, 15, 70), (30.0, 50, 200)])
@pytest.mark.parametrize("direction", [(0.0, 1.0, 0.0), (0.0, 0.0, -1.0)])
def test_push_moves_it_and_it_comes_back(arm, force_n, least_mm, most_mm, direction):
    start = arm.hand_pose().position
    arm.apply_force(force_n * np.array(direction), n_steps=2000)
    arm.step(2000)
    assert least_mm < displacement_mm(arm, start) < most_mm
    arm.step(2500)
    assert displacement_mm(arm, start) < 2.0


def test_push_deflects_as_the_stiffness_says(arm):
    """At rest, torque from stiffness balances J^T f (small deflection)."""
    force = np.array([0.0, 1.0, 0.5])
    arm.apply_force(force, n_steps=6000)
    arm.step(6000)
    state = arm.state()
    balance = arm.gains.stiffness * (state.q - np.array(READY_POSITION))
    assert np.allclose(balance, jacobian(state.q)[:3].T @ force, atol=1e-3)


def test_torque_and_reference_do_not_jump(arm):
    seen = []
    arm.before_step.append(lambda a: seen.append(np.abs(a.state().torque)))
    target = np.array(READY_POSITION) + np.array([2.0, 1.2, 2.0, -2.0, 2.0, 2.0, -2.8])
    arm.set_reference(target)
    arm.apply_force(np.array([0.0, 300.0, 100.0]), n_steps=500)
    arm.step(1500)
    assert np.all(np.array(seen) <= LWR_LIMITS.torque)
    assert arm.saturated_steps > 0
    arm.set_gravity_compensation(True)
    arm.apply_force(np.array([0.0, 15.0, 0.0]), n_steps=600)
    arm.step(2500)
    before = arm.state().q
    arm.set_gravity_compensation(False)
    assert np.array_equal(arm.reference.position, before)
    arm.step(1500)
    assert np.abs(arm.state().q - before).max() < 0.05


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("guided", [False, True])
def test_joint_limits_hold_under_a_push(arm, sign, guided):
    q = np.array(READY_POSITION)
    q[0] = sign * (LWR_LIMITS.upper[0] - 0.15)
    arm.reset(q)
    arm.set_gravity_compensation(guided)
    side = np.array([-np.sin(q[0]), np.cos(q[0]), 0.0]) * sign
    arm.apply_force(60.0 * side, n_steps=3000)
    worst = []
    arm.before_step.append(lambda a: worst.append(np.max(np.abs(a.state().q) - LWR_LIMITS.upper)))
    arm.step(3000)
    assert max(worst) < 0.005
    assert np.max(np.abs(arm.state().q[0])) > abs(q[0]) + 0.05


def test_a_spring_like_hand_guides_the_arm(arm):
    """Kinesthetic teaching: a hook pulls the hand toward a moving point; let go, it stops."""
    arm.set_gravity_compensation(True)
    start = arm.hand_pose().position
    goal = start + np.array([0.05, 0.20, 0.10])

    def pull(a):
        if a.time_s < 2.5:
            share = min(a.time_s / 1.5, 1.0)
            target = start + share * (goal - start)
            a.apply_force(300.0 * (target - a.hand_pose().position) - 25.0 * a.hand_velocity())

    arm.before_step.append(pull)
    arm.step(2500)
    assert np.linalg.norm(arm.hand_pose().position - goal) < 0.03
    arm.step(2000)
    assert np.abs(arm.state().qd).max() < 0.05


def test_two_runs_are_equal_bit_for_bit_and_noise_has_its_standard_deviation():
    ends = []
    for _ in range(2):
        with SimulatedArm() as arm:
            arm.apply_force(np.array([3.0, 20.0, -5.0]), n_steps=300)
            arm.step(800)
            ends.append(arm.state().q)
    assert np.array_equal(*ends)
    noise = SensorNoise(1e-3, 2e-2, 0.5)
    with SimulatedArm(noise=noise, rng=np.random.default_rng(5)) as arm:
        drawn = [arm.state() for _ in range(600)]
    for k, std in enumerate((1e-3, 2e-2, 0.5)):
        assert np.std([state[k] for state in drawn], axis=0).mean() == pytest.approx(std, rel=0.1)


def test_stiffness_scale_keeps_the_damping_ratio_and_bad_arguments_are_refused(arm):
    gains = ControllerGains()
    stiffer = gains.scaled(4.0)
    assert np.allclose(stiffer.stiffness, 4.0 * gains.stiffness)
    assert np.allclose(stiffer.damping, 2.0 * gains.damping)
    with pytest.raises(ArgumentError, match="stiffness_scale"):
        gains.scaled(0.0)
    with pytest.raises(ArgumentError, match="rng"):
        SimulatedArm(noise=SensorNoise())
    with pytest.raises(KinematicsError, match="lwr_a2_joint"):
        arm.reset(np.array([0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    with pytest.raises(ShapeError):
        arm.set_reference(np.zeros(6))
    with pytest.raises(ArgumentError, match="finite"):
        arm.set_reference(np.full(7, np.nan))
    with pytest.raises(ArgumentError, match="force_n"):
        arm.apply_force(np.array([np.inf, 0.0, 0.0]))
    with pytest.raises(ArgumentError, match="mass_kg"):
        arm.set_payload(-1.0)

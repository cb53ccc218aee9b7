# SPDX-License-Identifier: Apache-2.0
"""The force at the hand, from torques that another model of the same arm makes."""

import numpy as np
import pytest

from intent_recognition.errors import ShapeError
from intent_recognition.kinematics import Arm
from intent_recognition.transfer import LoadEstimator
from intent_recognition.transfer.load import BANDWIDTH_RAD_S
from sim_bridge.arm import SensorNoise, SimulatedArm, find_robot
from sim_bridge.handover import with_fingers

PUSH_N = np.array([3.0, 0.0, -5.0])
ROBOT = find_robot("lwr")
LWR, READY = Arm.from_urdf(ROBOT.urdf, tip=ROBOT.tip), ROBOT.ready


@pytest.mark.parametrize("name", ["lwr", "panda"])
def test_a_push_is_felt_as_it_is(name):
    """Force, time until it is felt, and its noise, against a push in the physics."""
    robot = with_fingers(find_robot(name))
    rng = np.random.default_rng(0)
    with SimulatedArm(robot=robot, noise=SensorNoise(), rng=rng) as arm:
        estimator = LoadEstimator(Arm.from_urdf(robot.urdf, tip=robot.tip))

        def push(arm):
            if arm.time_s >= 1.0:
                arm.apply_force(PUSH_N)

        arm.before_step.append(push)
        forces = []
        for _ in range(300):
            arm.step(5)
            state = arm.state()
            forces.append(estimator.update(state.time_s, state.q, state.qd, state.torque))
    forces = np.array(forces)
    np.testing.assert_allclose(forces[40:200].mean(0), 0.0, atol=0.25)
    assert np.all(forces[40:200].std(0) < 1.0)
    np.testing.assert_allclose(forces[220:].mean(0), PUSH_N, atol=0.4)
    along = forces @ PUSH_N / (PUSH_N @ PUSH_N)
    assert along[205:211].mean() > 0.5  # within 50 ms


def test_static_torques_are_the_jacobian_times_the_force():
    """Without motion the estimate is a linear map, whose inverse is J^T."""
    zero = np.zeros(LWR.n_joints)
    held = LWR.inverse_dynamics(READY, zero, zero)
    wrench = np.array([4.0, -2.0, -7.0, 0.1, 0.2, 0.0])
    torque = held - LWR.jacobian(READY).T @ wrench
    force = LoadEstimator(LWR).update(0.0, READY, zero, torque)
    np.testing.assert_allclose(force, wrench[:3], atol=0.1)


def test_a_quick_motion_is_no_load():
    """A joint that swings at up to 15 rad/s^2 within half a second, and nothing at the hand."""
    estimator, swing, length_s = LoadEstimator(LWR), 15.0 * np.eye(LWR.n_joints)[1], 0.5
    per_rad_s = length_s / (2.0 * np.pi)
    forces, speeds, rises = [], [], []
    for t in np.arange(0.0, length_s, 0.005):
        qdd, qd = swing * np.sin(t / per_rad_s), swing * per_rad_s * (1.0 - np.cos(t / per_rad_s))
        q = READY + swing * per_rad_s * (t - per_rad_s * np.sin(t / per_rad_s))
        forces.append(estimator.update(t, q, qd, LWR.inverse_dynamics(q, qd, qdd)))
        speeds.append(LWR.jacobian(q)[2] @ qd)
        rises.append(estimator.rise_m_s2)
    late = round(1.0 / (BANDWIDTH_RAD_S * 0.005))  # of the filter
    accelerations = np.gradient(speeds, 0.005)
    assert np.abs(accelerations).max() > 5.0
    np.testing.assert_allclose(rises[20 + late :], accelerations[20:-late], atol=0.5)
    assert np.abs(forces).max() < 0.1  # 1.6 N with torques of the later measurement


@pytest.mark.parametrize("at", [0.0, 0.5, 0.99])
def test_a_step_between_two_measurements_is_in_doubt(at):
    """At which part of the interval the torques stepped is not known: it may look like a load."""
    estimator, step_s, q = LoadEstimator(LWR), 0.005, READY
    hard, rest, doubts = np.eye(LWR.n_joints)[1] * 8.0, np.zeros(LWR.n_joints), []
    for k in range(21):
        moving = max(k - 10 - at, 0.0) * step_s
        torque = LWR.inverse_dynamics(q, hard * moving, hard if moving else rest)
        force = estimator.update(k * step_s, q, hard * moving, torque)
        doubts.append(estimator.doubt_n)
        assert abs(force[2]) < doubts[-1] + 1.0
    assert max(doubts) > 1.0 and doubts[-1] < 0.2 * max(doubts)


def test_states_that_are_late_or_far_apart():
    """One that is no later changes nothing; after a gap, or far back, the filter begins anew."""
    zero = np.zeros(LWR.n_joints)
    torque = LWR.inverse_dynamics(READY, zero, zero)
    torque = torque - LWR.jacobian(READY)[2] * -6.0
    estimator = LoadEstimator(LWR)
    first = estimator.update(1.0, READY, zero, torque).copy()
    np.testing.assert_array_equal(estimator.update(0.95, READY, zero, zero), first)
    again = estimator.update(5.0, READY, zero, torque)
    np.testing.assert_allclose(again, first, atol=1e-9)
    unloaded = LWR.inverse_dynamics(READY, zero, zero)
    np.testing.assert_allclose(estimator.update(5.2, READY, zero, unloaded), 0.0, atol=1e-9)
    assert estimator.doubt_n == pytest.approx(np.abs(first[2]) - 0.5)
    np.testing.assert_allclose(estimator.update(4.9, READY, zero, torque), first, atol=1e-9)
    with pytest.raises(ShapeError, match="torque"):
        estimator.update(6.0, READY, zero, zero[:3])

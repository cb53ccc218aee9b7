# SPDX-License-Identifier: Apache-2.0
"""The arm's dynamics against pinocchio's recursive Newton-Euler, and the inertias of its model."""

import numpy as np
import pinocchio
import pytest
from kinematics.robots import lwr_urdf

from sim_bridge.arm.arm import SimulatedArm

ROTORS_KG_M2 = (0.20, 0.20, 0.12, 0.12, 0.08, 0.04, 0.04)
MODEL = pinocchio.buildModelFromXML(lwr_urdf())


@pytest.fixture(scope="module")
def arm():
    with SimulatedArm() as made:
        yield made


@pytest.mark.parametrize("seed", range(4))
def test_a_free_step_accelerates_as_newton_euler_says(arm, seed):
    """From rest; with speed, its inverse dynamics does as the controller asks it."""
    rng = np.random.default_rng(seed)
    q, qdd = rng.uniform(-2.0, 2.0, 7), rng.uniform(-2.0, 2.0, 7)
    torque = pinocchio.rnea(MODEL, MODEL.createData(), q, np.zeros(7), qdd)
    arm.reset(q)
    arm.client.setJointMotorControlArray(
        arm.body, arm.joint_indices, arm.client.TORQUE_CONTROL, forces=torque.tolist()
    )
    arm.client.stepSimulation()
    velocity = [s[1] for s in arm.client.getJointStates(arm.body, arm.joint_indices)]
    assert np.allclose(velocity, 0.001 * qdd, atol=1e-7)
    rates, wanted = rng.uniform(-2.0, 2.0, (2, 7))
    model = arm.client.calculateInverseDynamics(arm.body, *map(list, (q, rates, wanted)))
    assert np.allclose(
        model, pinocchio.rnea(MODEL, MODEL.createData(), q, rates, wanted), atol=1e-8
    )


def test_inertias_are_those_of_real_bodies_with_their_rotors():
    """PyBullet silently zeroes an inertia that breaks the triangle inequality."""
    for body, rotor in zip(MODEL.inertias[1:], ROTORS_KG_M2, strict=True):
        moments = np.diag(body.inertia)
        assert np.all(moments > 0.5 * rotor)
        assert moments[2] > rotor
        assert 2.0 * moments.max() <= moments.sum() + 1e-12

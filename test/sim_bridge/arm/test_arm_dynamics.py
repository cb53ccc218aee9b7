# SPDX-License-Identifier: Apache-2.0
"""The arm's dynamics against an independent recursive Newton-Euler; its model and looks."""

from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats
from kinematics.robots import lwr_urdf

from intent_recognition.kinematics.lwr import ALPHA_RAD, D_M
from sim_bridge.arm.arm import GRAVITY_M_S2, SimulatedArm

ROTORS_KG_M2 = (0.20, 0.20, 0.12, 0.12, 0.08, 0.04, 0.04)
joints = arrays(np.float64, 7, elements=floats(-2.0, 2.0))


@pytest.fixture(scope="module")
def arm():
    with SimulatedArm() as made:
        yield made


def numbers(text):
    return np.array([float(word) for word in text.split()])


def body_of(inertial):
    """Mass, centre (3,) and moments (3,) of a link along its axes."""
    moments = [float(inertial.find("inertia").get(key)) for key in ("ixx", "iyy", "izz")]
    centre = numbers(inertial.find("origin").get("xyz"))
    return float(inertial.find("mass").get("value")), centre, np.array(moments)


BODIES = [body_of(link.find("inertial")) for link in ET.fromstring(lwr_urdf()).findall("link")[1:8]]


def newton_euler(q, qd, qdd):
    """Joint torques (7,) by the textbook recursion in link frames, from the DH table."""
    rotations, offsets = [], []
    for i in range(7):
        turn = ALPHA_RAD[i - 1] if i else 0.0
        c, s, ca, sa = np.cos(q[i]), np.sin(q[i]), np.cos(turn), np.sin(turn)
        about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        rotations.append(about_x @ about_z)
        offsets.append(np.array([0.0, 0.0, D_M[i - 1] if i else 0.0]))
    z = np.array([0.0, 0.0, 1.0])
    w, dw, a = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, GRAVITY_M_S2])
    forces, moments = [], []
    for i in range(7):
        R, p = rotations[i], offsets[i]
        a = R.T @ (a + np.cross(dw, p) + np.cross(w, np.cross(w, p)))
        w_before = R.T @ w
        w = w_before + qd[i] * z
        dw = R.T @ dw + qdd[i] * z + np.cross(w_before, qd[i] * z)
        mass, com, moments_of_inertia = BODIES[i]
        I = np.diag(moments_of_inertia)
        a_com = a + np.cross(dw, com) + np.cross(w, np.cross(w, com))
        forces.append(mass * a_com)
        moments.append(I @ dw + np.cross(w, I @ w) + np.cross(com, forces[-1]))
    torque, f, n = np.zeros(7), np.zeros(3), np.zeros(3)
    for i in reversed(range(7)):
        if i < 6:
            R, p = rotations[i + 1], offsets[i + 1]
            n = R @ n + np.cross(p, R @ f)
            f = R @ f
        f, n = f + forces[i], n + moments[i]
        torque[i] = n[2]
    return torque


@pytest.mark.slow
@settings(deadline=None)
@given(joints, joints, joints)
def test_inverse_dynamics_matches_newton_euler(arm, q, qd, qdd):
    model = arm.client.calculateInverseDynamics(arm.body, q.tolist(), qd.tolist(), qdd.tolist())
    assert np.allclose(model, newton_euler(q, qd, qdd), atol=1e-8)


def test_a_free_step_accelerates_as_newton_euler_says(arm):
    rng = np.random.default_rng(4)
    q, qdd = rng.uniform(-1.0, 1.0, 7), rng.uniform(-2.0, 2.0, 7)
    arm.reset(q)
    arm.client.setJointMotorControlArray(
        arm.body,
        arm.joint_indices,
        arm.client.TORQUE_CONTROL,
        forces=newton_euler(q, np.zeros(7), qdd).tolist(),
    )
    arm.client.stepSimulation()
    velocity = [s[1] for s in arm.client.getJointStates(arm.body, arm.joint_indices)]
    assert np.allclose(velocity, 0.001 * qdd, atol=1e-7)


def test_inertias_are_those_of_real_bodies_with_their_rotors():
    """PyBullet silently zeroes an inertia that breaks the triangle inequality."""
    for (_, _, moments), rotor in zip(BODIES, ROTORS_KG_M2, strict=True):
        assert np.all(moments > 0.5 * rotor)
        assert moments[2] > rotor
        assert 2.0 * moments.max() <= moments.sum() + 1e-12

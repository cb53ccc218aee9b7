# SPDX-License-Identifier: Apache-2.0
"""The arm's dynamics against an independent recursive Newton-Euler; its model and looks."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats

from intent_recognition.kinematics.forward import jacobian
from intent_recognition.kinematics.lwr import DH, JOINT_NAMES, LWR_LIMITS
from sim_bridge.arm.arm import GRAVITY_M_S2, SimulatedArm
from sim_bridge.arm.urdf import LINK_BODIES, ROTOR_INERTIA_KG_M2, link_inertia, lwr_urdf

joints = arrays(np.float64, 7, elements=floats(-2.0, 2.0))


@pytest.fixture(scope="module")
def arm():
    with SimulatedArm() as made:
        yield made


def newton_euler(q, qd, qdd):
    """Joint torques (7,) by the textbook recursion in link frames, from the DH table."""
    rotations, offsets = [], []
    for i in range(7):
        turn = DH.alpha_rad[i - 1] if i else 0.0
        c, s, ca, sa = np.cos(q[i]), np.sin(q[i]), np.cos(turn), np.sin(turn)
        about_x = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
        about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        rotations.append(about_x @ about_z)
        offsets.append(np.array([0.0, 0.0, DH.d_m[i - 1] if i else 0.0]))
    z = np.array([0.0, 0.0, 1.0])
    w, dw, a = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, GRAVITY_M_S2])
    forces, moments = [], []
    for i in range(7):
        R, p = rotations[i], offsets[i]
        a = R.T @ (a + np.cross(dw, p) + np.cross(w, np.cross(w, p)))
        w_before = R.T @ w
        w = w_before + qd[i] * z
        dw = R.T @ dw + qdd[i] * z + np.cross(w_before, qd[i] * z)
        com = np.array(LINK_BODIES[i].centre)
        I = np.diag(link_inertia(i, ROTOR_INERTIA_KG_M2[i]))
        a_com = a + np.cross(dw, com) + np.cross(w, np.cross(w, com))
        forces.append(LINK_BODIES[i].mass * a_com)
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
    """The torque of a wanted acceleration, applied for one step, gives that acceleration."""
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


def test_inertias_are_those_of_real_bodies():
    """PyBullet silently zeroes an inertia that breaks the triangle inequality."""
    for i, J in enumerate(ROTOR_INERTIA_KG_M2):
        moments = link_inertia(i, J)
        assert np.all(moments > 0.0)
        assert 2.0 * moments.max() <= moments.sum() + 1e-12


def test_pybullet_took_the_masses_and_inertias(arm):
    for i, index in enumerate(arm.joint_indices):
        info = arm.client.getDynamicsInfo(arm.body, index)
        assert info[0] == pytest.approx(LINK_BODIES[i].mass)
        assert np.allclose(sorted(info[2]), sorted(link_inertia(i, ROTOR_INERTIA_KG_M2[i])))
    assert arm.client.getDynamicsInfo(arm.body, arm.hand_link)[0] == 0.0


def test_jacobian_of_pybullet_is_ours(arm):
    q = np.array([0.3, -0.7, 0.2, 1.1, -0.4, 0.8, 0.5])
    zeros = [0.0] * 7
    linear, angular = arm.client.calculateJacobian(
        arm.body, arm.hand_link, zeros[:3], q.tolist(), zeros, zeros
    )
    assert np.allclose(np.vstack([linear, angular]), jacobian(q), atol=1e-6)


def test_urdf_is_plain_and_complete():
    robot = ET.fromstring(lwr_urdf())
    revolute = [j for j in robot.iter("joint") if j.get("type") == "revolute"]
    assert [joint.get("name") for joint in revolute] == list(JOINT_NAMES)
    for i, joint in enumerate(revolute):
        assert float(joint.find("limit").get("upper")) == LWR_LIMITS.upper[i]
        assert float(joint.find("limit").get("effort")) == LWR_LIMITS.torque[i]
    kinds = {shape.tag for geometry in robot.iter("geometry") for shape in geometry}
    assert kinds == {"box", "cylinder", "sphere"}
    assert len(robot.findall("link")) == 9
    assert "lwr_hand" in {link.get("name") for link in robot.findall("link")}


def test_picture_shows_an_orange_and_grey_arm(arm):
    """The software renderer sees orange shells, grey drums and a dark flange."""
    arm.reset()
    view = arm.client.computeViewMatrix((1.6, -1.2, 0.9), (0.2, 0.0, 0.5), (0.0, 0.0, 1.0))
    lens = arm.client.computeProjectionMatrixFOV(45.0, 4.0 / 3.0, 0.1, 5.0)
    image = arm.client.getCameraImage(320, 240, view, lens, renderer=arm.client.ER_TINY_RENDERER)
    pixels = np.reshape(image[2], (-1, 4))[:, :3].astype(float)
    arm_pixels = pixels[np.reshape(image[4], -1) == arm.body]
    assert len(arm_pixels) > 1500
    r, g, b = arm_pixels.T
    assert np.mean((r > 1.6 * g) & (g > b)) > 0.3
    assert np.mean((np.abs(r - g) < 20) & (np.abs(g - b) < 20)) > 0.15

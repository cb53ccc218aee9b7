# SPDX-License-Identifier: Apache-2.0
"""The torque-controlled LWR 4+ in its own PyBullet world.

`LwrArm` owns one `BulletClient`; other bodies and constraints may be added to the same world
through `arm.client` and `arm.body`. Frames: `world` with the arm's base at the origin, unless
another base position is given. Units: m, rad, s, N, Nm.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pybullet
from numpy.typing import NDArray
from pybullet_utils.bullet_client import BulletClient

from intent_recognition.errors import ArgumentError, ShapeError, describe
from intent_recognition.kinematics import (
    JOINT_NAMES,
    LWR_LIMITS,
    N_JOINTS,
    JointLimits,
    check_position,
)
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm.controllers import (
    ControllerGains,
    guiding_torque,
    impedance_torque,
    limit_torque,
)
from sim_bridge.arm.state import ArmState, HandPose, SensorNoise
from sim_bridge.arm.trajectory_follower import ArmReference
from sim_bridge.arm.urdf import lwr_urdf
from sim_bridge.arm.urdf_loading import free_joints, load_urdf

TIME_STEP_S = 0.001
"""Physics step of the arm's world [s]; torques are computed anew in each, as the real arm does."""
STEPS_PER_SAMPLE = 10
"""Physics steps between two recorded samples: 100 samples a second."""
# An elbow-up posture with the hand in front of the base, fingers down: all limits are far away.
READY_POSITION: tuple[float, ...] = (0.0, -0.45, 0.0, 1.55, 0.0, -1.1415926535897931, 0.0)
"""Joint angles [rad] with the elbow bent and the hand in front of the base. Convention."""


AccelerationLaw = Callable[[float, NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""From time [s], joint angles and velocities (7,) to the joint accelerations wanted (7,)."""


@dataclass
class _Push:
    link: int
    force: tuple[float, float, float]
    point: tuple[float, float, float]
    steps_left: int


class LwrArm:
    """The arm, its torque controller and its world.

    Two modes: following a reference (`set_reference`), with inverse-dynamics feed-forward and
    joint stiffness and damping, or gravity compensation (`set_gravity_compensation`), where only
    gravity, a little friction and the limits act and a hand may guide it. Hooks in
    `before_step` are called with the arm before every physics step and may set references, push
    the arm, or act on other bodies of the world.

    Args:
        initial_position: joint angles at the start (7,) [rad].
        gains: stiffness, damping and friction.
        limits: joint limits; torques are clipped to `limits.torque`.
        noise: standard deviations of the sensors; None measures exactly.
        rng: random generator of the sensor noise; required with `noise`.
        client: a world to join; a new headless one by default.
        headless: False opens PyBullet's window (needs a display).
        base_position_m: where the base stands in the world (3,).

    Raises:
        KinematicsError: initial_position is outside the joint limits.
    """

    def __init__(
        self,
        initial_position: NDArray[np.float64] | tuple[float, ...] = READY_POSITION,
        *,
        gains: ControllerGains | None = None,
        limits: JointLimits = LWR_LIMITS,
        noise: SensorNoise | None = None,
        rng: np.random.Generator | None = None,
        client: BulletClient | None = None,
        headless: bool = True,
        base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        if noise is not None and rng is None:
            raise ArgumentError(describe("rng", "a Generator with noise", None, "Pass one."))
        self.gains = gains if gains is not None else ControllerGains()
        self.limits = limits
        self.before_step: list[Callable[[LwrArm], None]] = []
        self.saturated_steps = 0
        self._noise, self._rng = noise, rng
        self._owns_client = client is None
        mode = pybullet.DIRECT if headless else pybullet.GUI
        self.client = client if client is not None else BulletClient(mode)
        self.urdf = lwr_urdf()
        self.body = load_urdf(self.client, self.urdf, base_position_m)
        self.joint_indices, self.hand_link = free_joints(self.client, self.body)
        self.client.setTimeStep(TIME_STEP_S)
        self.client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
        self._payload_mass_kg = 0.0
        self._payload_com_m = (0.0, 0.0, 0.0)
        self._gravity_compensation = False
        self._law: AccelerationLaw | None = None
        self.reset(initial_position)

    @property
    def n_steps(self) -> int:
        """Physics steps of 1 ms since the last reset."""
        return self._n_steps

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset."""
        return self._n_steps * TIME_STEP_S

    @property
    def reference(self) -> ArmReference:
        """The reference being followed (while in gravity compensation: the last one)."""
        return self._reference

    @property
    def gravity_compensation(self) -> bool:
        """Whether the arm may be guided by hand."""
        return self._gravity_compensation

    def reset(self, q: NDArray[np.float64] | tuple[float, ...] = READY_POSITION) -> None:
        """Put the arm at rest at q (7,) [rad], hold there, set its time to zero, end all pushes."""
        q = _joint_array(q, "q")
        check_position(q, self.limits, JOINT_NAMES)
        for index, angle in zip(self.joint_indices, q, strict=True):
            self.client.resetJointState(self.body, index, float(angle), 0.0)
        self._n_steps = 0
        self._pushes: list[_Push] = []
        self._torque = np.zeros(N_JOINTS)
        self.saturated_steps = 0
        self._read()
        self.set_reference(q)

    def step(self, n_steps: int = 1) -> None:
        """Advance control and physics by n_steps of 1 ms."""
        for _ in range(n_steps):
            for hook in self.before_step:
                hook(self)
            self._apply_torque()
            self._apply_pushes()
            self.client.stepSimulation()
            self._n_steps += 1
            self._read()

    def state(self) -> ArmState:
        """Return the measured joint state, with sensor noise if the arm was given any."""
        exact = ArmState(self._q.copy(), self._qd.copy(), self._torque.copy(), self.time_s)
        if self._noise is None or self._rng is None:
            return exact
        return self._noise.measure(exact, self._rng)

    def hand_pose(self) -> HandPose:
        """Return the true pose of the hand (DH frame 7) in the world."""
        link = self.client.getLinkState(self.body, self.hand_link, computeForwardKinematics=1)
        return HandPose(np.array(link[4]), np.array(link[5]))

    def hand_velocity(self) -> NDArray[np.float64]:
        """Return the true linear velocity of the hand in the world (3,) [m/s]."""
        link = self.client.getLinkState(
            self.body, self.hand_link, computeLinkVelocity=1, computeForwardKinematics=1
        )
        return np.array(link[6])

    def set_reference(
        self,
        q: NDArray[np.float64],
        qd: NDArray[np.float64] | None = None,
        qdd: NDArray[np.float64] | None = None,
    ) -> None:
        """Follow q (7,) [rad] moving at qd [rad/s] and qdd [rad/s^2]; zero where left out.

        Positions outside the joint limits are clamped into them.
        """
        q = np.clip(_joint_array(q, "q"), self.limits.lower, self.limits.upper)
        qd = np.zeros(N_JOINTS) if qd is None else _joint_array(qd, "qd")
        qdd = np.zeros(N_JOINTS) if qdd is None else _joint_array(qdd, "qdd")
        self._reference = ArmReference(q, qd, qdd)

    def set_acceleration_law(self, law: AccelerationLaw | None) -> None:
        """Do the accelerations a law asks for, by inverse dynamics alone; None: low gains again.

        The law replaces the reference and its stiffness, as a `FeedbackPolicy.acceleration` does.
        """
        self._law = law

    def set_gravity_compensation(self, enabled: bool) -> None:
        """Let go of the reference, or take hold again of the position where the arm is now."""
        if self._gravity_compensation and not enabled:
            self.set_reference(self._q)
        self._gravity_compensation = enabled

    def set_payload(
        self, mass_kg: float, com_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        """Compensate the weight of a body in the hand by J^T f; the body itself is not added.

        Args:
            mass_kg: its mass; 0 when it was released.
            com_m: its centre of mass in the hand frame (3,).
        """
        if not (np.isfinite(mass_kg) and mass_kg >= 0.0 and np.all(np.isfinite(com_m))):
            raise ArgumentError(
                describe("mass_kg, com_m", "finite, mass >= 0", (mass_kg, com_m), "Check them.")
            )
        self._payload_mass_kg = float(mass_kg)
        x, y, z = com_m
        self._payload_com_m = float(x), float(y), float(z)

    def apply_force(
        self,
        force_n: NDArray[np.float64],
        *,
        n_steps: int = 1,
        point_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        link: int | None = None,
    ) -> None:
        """Push the arm with a force constant in the world for the next n_steps.

        Several pushes add up. A spring that follows a hand calls this once per step.

        Args:
            force_n: force in world axes (3,).
            n_steps: for how many steps of 1 ms.
            point_m: where it acts, in the axes of the link (3,).
            link: link index in PyBullet; the hand by default.
        """
        force = np.asarray(force_n, dtype=np.float64)
        if force.shape != (3,) or not np.all(np.isfinite(force)):
            raise ArgumentError(
                describe("force_n", "three finite numbers", force_n, "Check the push.")
            )
        link = self.hand_link if link is None else link
        point = (float(point_m[0]), float(point_m[1]), float(point_m[2]))
        self._pushes.append(_Push(link, tuple(force.tolist()), point, int(n_steps)))

    def close(self) -> None:
        """Disconnect from the world if this arm made it."""
        if self._owns_client and self.client.isConnected():
            self.client.disconnect()

    def __enter__(self) -> "LwrArm":
        """Return the arm."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the world."""
        self.close()

    def _apply_torque(self) -> None:
        q, qd = self._q, self._qd
        guided = self._gravity_compensation
        # Guided: gravity only (no velocity, no acceleration terms), the arm's inertia is felt.
        velocity = [0.0] * N_JOINTS if guided else qd.tolist()
        acceleration = [0.0] * N_JOINTS if guided else self._wanted_acceleration().tolist()
        model = self.client.calculateInverseDynamics(self.body, q.tolist(), velocity, acceleration)
        torque = np.array(model) + limit_torque(self.gains, self.limits, q, qd)
        if guided:
            torque += guiding_torque(self.gains, qd)
        elif self._law is None:
            ref = self._reference
            torque += impedance_torque(self.gains, q, qd, ref.q, ref.qd)
        if self._payload_mass_kg > 0.0:
            torque += self._payload_torque()
        bound = self.limits.torque
        self._torque = np.minimum(np.maximum(torque, -bound), bound)
        if (self._torque != torque).any():
            self.saturated_steps += 1
        self.client.setJointMotorControlArray(
            self.body,
            self.joint_indices,
            pybullet.TORQUE_CONTROL,
            forces=self._torque.tolist(),
        )

    def _wanted_acceleration(self) -> NDArray[np.float64]:
        if self._law is None:
            return self._reference.qdd
        return self._law(self.time_s, self._q, self._qd)

    def _payload_torque(self) -> NDArray[np.float64]:
        zeros = [0.0] * N_JOINTS
        linear, _ = self.client.calculateJacobian(
            self.body, self.hand_link, self._payload_com_m, self._q.tolist(), zeros, zeros
        )
        return np.array(linear[2]) * (self._payload_mass_kg * GRAVITY_M_S2)

    def _apply_pushes(self) -> None:
        if not self._pushes:
            return
        for push in self._pushes:
            link = self.client.getLinkState(self.body, push.link)
            point, _ = self.client.multiplyTransforms(
                link[4], link[5], push.point, (0.0, 0.0, 0.0, 1.0)
            )
            self.client.applyExternalForce(
                self.body, push.link, push.force, point, pybullet.WORLD_FRAME
            )
            push.steps_left -= 1
        self._pushes = [push for push in self._pushes if push.steps_left > 0]

    def _read(self) -> None:
        states = self.client.getJointStates(self.body, self.joint_indices)
        self._q = np.array([joint[0] for joint in states])
        self._qd = np.array([joint[1] for joint in states])


def _joint_array(
    values: NDArray[np.float64] | tuple[float, ...], argument: str
) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.shape != (N_JOINTS,):
        raise ShapeError(describe(argument, "shape (7,)", array.shape, "Give seven joints."))
    if not np.all(np.isfinite(array)):
        raise ArgumentError(describe(argument, "finite values", array, "Check the source."))
    return array

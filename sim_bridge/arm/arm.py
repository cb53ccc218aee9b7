# SPDX-License-Identifier: Apache-2.0
"""A torque-controlled arm in its own PyBullet world: the LWR 4+, or any other.

`SimulatedArm` owns one `BulletClient`; other bodies and constraints may be added to the same world
through `arm.client` and `arm.body`. Poses are in the frame `world`, which has the arm's base at its
origin unless another base position is given. Units: m, rad, s, N, Nm.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.kinematics import check_position
from intent_recognition.motion import JointReference
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm.controllers import guiding_torque, impedance_torque, limit_torque
from sim_bridge.arm.robots import Robot, derived_gains, find_robot
from sim_bridge.arm.state import ArmState, HandPose, SensorNoise
from sim_bridge.arm.urdf_loading import HeldJoints, free_joints, load_urdf, stop_at_fixtures
from sim_bridge.physics import end_world, pybullet, start_world

TIME_STEP_S = 0.001
"""Physics step of the arm's world [s]; torques are computed in each step, as in the real arm."""
STEPS_PER_SAMPLE = 10
"""Physics steps between two recorded samples: 100 samples a second."""
AccelerationLaw = Callable[[float, Floats, Floats], Floats]
"""Function from time [s], joint angles and velocities (n,) to desired joint accelerations (n,)."""


class _Push(NamedTuple):
    until_step: int
    link: int
    force: tuple[float, float, float]
    point: tuple[float, float, float]


class SimulatedArm(AbstractContextManager["SimulatedArm"]):
    """The arm, its torque controller and its world.

    The arm has two modes. It follows a reference (`set_reference`) with inverse-dynamics
    feed-forward, joint stiffness and damping; or it is in gravity compensation
    (`set_gravity_compensation`), where only gravity, a little friction and the limits act and it
    may be guided by hand. Hooks in `before_step` are called with the arm before every physics step;
    they may set references, push the arm, or act on other bodies of the world.

    Links that the URDF fixes to its root, such as a table, stop the arm (`fixtures`, by number).

    Args:
        initial_position: joint angles at the start (n,) [rad]; the ready posture by default.
        robot: the arm to simulate; the LWR by default.
        stiffness_scale: factor on the joint stiffness.
        noise: sensor noise, which needs an `rng`; None measures exactly.
        rng: draws the sensor noise.
        headless: False opens PyBullet's window (needs a display).

    Attributes:
        others: joints outside the chain, such as fingers.
        n_steps: physics steps of 1 ms since the last reset.
        reference: the current reference, or the last one in gravity compensation.
        gravity_compensation: whether the arm may be guided by hand.
        acceleration_law: gives accelerations that inverse dynamics executes instead of the
            reference and its stiffness; None for the low gains of the reference.

    Raises:
        KinematicsError: initial_position is outside the joint limits.
        ArgumentError: PyBullet cannot load the robot.
    """

    def __init__(
        self,
        initial_position: Floats | Sequence[float] | None = None,
        *,
        robot: Robot | None = None,
        stiffness_scale: float = 1.0,
        noise: SensorNoise | None = None,
        rng: np.random.Generator | None = None,
        headless: bool = True,
    ) -> None:
        if noise is not None and rng is None:
            raise ArgumentError.about("rng", "a Generator with noise", None, "Pass one.")
        self.robot = robot if robot is not None else find_robot("lwr")
        self.limits = self.robot.limits
        self.before_step: list[Callable[[SimulatedArm], None]] = []
        self.saturated_steps = 0
        self._noise, self.rng = noise, rng
        self.client = start_world(headless=headless)
        self.body = load_urdf(self.client, self.robot.urdf, self.robot.base_position_m)
        names = self.robot.joint_names
        self.joint_indices, self.hand_link, moving = free_joints(
            self.client, self.body, names, self.robot.tip
        )
        self._n_moving = len(moving)
        self._columns = np.array([[j.name for j in moving].index(name) for name in names])
        self._order = np.argsort(self._columns)
        others = [joint for joint in moving if joint.name not in names]
        self.others = HeldJoints(self.client, self.body, others)
        self._other_columns = [moving.index(joint) for joint in others]
        self.client.setTimeStep(TIME_STEP_S)
        self.client.setGravity(0.0, 0.0, -GRAVITY_M_S2)
        self._payload_mass_kg = 0.0
        self._payload_com_m = (0.0, 0.0, 0.0)
        self.gravity_compensation = False
        self.acceleration_law: AccelerationLaw | None = None
        self.reset(initial_position)
        self.fixtures = stop_at_fixtures(
            self.client, self.body, self.robot.urdf, self.joint_indices
        )
        every = self._all_joints(self._q, measured=True)
        try:
            mass = self.client.calculateMassMatrix(self.body, every)
        except SystemError as error:  # inertias whose rounding errors are larger than 5e-15
            expected, cure = "links whose inertias PyBullet takes", "Take a smaller arm."
            raise ArgumentError.about("robot", expected, "too heavy ones", cure) from error
        inertia = np.diag(mass)[self._columns]  # inertia of each joint alone [kg m^2]
        gains = self.robot.gains or derived_gains(self.limits.torque, inertia)
        self.gains = gains.scaled(stiffness_scale)
        margin = self.gains.limit_margin_rad
        self._free = self.limits.lower + margin, self.limits.upper - margin

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset."""
        return self.n_steps * TIME_STEP_S

    def reset(self, q: Floats | Sequence[float] | None = None) -> None:
        """Put the arm at rest at q (n,) [rad], hold there, set its time to zero, end all pushes."""
        q = self._joint_array(self.robot.ready if q is None else q, "q")
        check_position(q, self.limits, self.robot.joint_names)
        self.others.reset()
        for index, angle in zip(self.joint_indices, q, strict=True):
            self.client.resetJointState(self.body, index, float(angle), 0.0)
        self.n_steps = 0
        self._pushes: list[_Push] = []
        self._torque = np.zeros(self.robot.n_joints)
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
            self.n_steps += 1
            self._read()

    def state(self) -> ArmState:
        """Return the measured joint state, with sensor noise if the arm was given any."""
        exact = ArmState(self._q.copy(), self._qd.copy(), self._torque.copy(), self.time_s)
        if self._noise is None or self.rng is None:
            return exact
        return self._noise.measure(exact, self.rng)

    def hand_pose(self) -> HandPose:
        """Return the true pose of the hand (the link `robot.tip`) in the world."""
        link = self.client.getLinkState(self.body, self.hand_link, computeForwardKinematics=1)
        return HandPose(np.array(link[4]), np.array(link[5]))

    def hand_velocity(self) -> Floats:
        """Return the true linear velocity of the hand in the world (3,) [m/s]."""
        link = self.client.getLinkState(
            self.body, self.hand_link, computeLinkVelocity=1, computeForwardKinematics=1
        )
        return np.array(link[6])

    def set_reference(self, q: Floats, qd: Floats | None = None, qdd: Floats | None = None) -> None:
        """Follow q (n,) [rad] moving at qd [rad/s] and qdd [rad/s^2]; zero where left out.

        Positions outside the joint limits are clamped into them.
        """
        q = np.maximum(self._joint_array(q, "q"), self.limits.lower)
        q = np.minimum(q, self.limits.upper)
        qd = np.zeros(self.robot.n_joints) if qd is None else self._joint_array(qd, "qd")
        qdd = np.zeros(self.robot.n_joints) if qdd is None else self._joint_array(qdd, "qdd")
        self.reference = JointReference(q, qd, qdd)

    def set_gravity_compensation(self, enabled: bool) -> None:
        """Stop following the reference, or hold the present position again."""
        if self.gravity_compensation and not enabled:
            self.set_reference(self._q)
        self.gravity_compensation = enabled

    def set_payload(
        self, mass_kg: float, com_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> None:
        """Compensate the weight of a body in the hand by J^T f; the body itself is not added.

        `com_m` is its centre of mass in the hand frame (3,). Set the mass to 0 when it is released.
        """
        if not (np.isfinite(mass_kg) and mass_kg >= 0.0 and np.all(np.isfinite(com_m))):
            cure = "Check them."
            raise ArgumentError.about("mass_kg, com_m", "finite, mass >= 0", (mass_kg, com_m), cure)
        self._payload_mass_kg = float(mass_kg)
        x, y, z = com_m
        self._payload_com_m = float(x), float(y), float(z)

    def apply_force(
        self,
        force_n: Floats,
        *,
        n_steps: int = 1,
        point_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
        link: int | None = None,
    ) -> None:
        """Push the arm with a force (3,), constant in world axes, for the next steps of 1 ms.

        The force acts at a point (3,) in the axes of a link (PyBullet's index), by default the
        hand. Several pushes add up. To simulate a spring, call this once per step.
        """
        force = np.asarray(force_n, dtype=np.float64)
        if force.shape != (3,) or not np.all(np.isfinite(force)):
            raise ArgumentError.about("force_n", "three finite numbers", force_n, "Check the push.")
        link = self.hand_link if link is None else link
        point = (float(point_m[0]), float(point_m[1]), float(point_m[2]))
        until = self.n_steps + int(n_steps)
        self._pushes.append(_Push(until, link, tuple(force.tolist()), point))

    def close(self) -> None:
        """Disconnect from the world."""
        end_world(self.client)

    def __exit__(self, *_: object) -> None:
        self.close()

    def _apply_torque(self) -> None:
        q, qd, law = self._q, self._qd, self.acceleration_law
        guided = self.gravity_compensation
        wanted = self.reference.acceleration if law is None else law(self.time_s, q, qd)
        # Guided: only gravity is compensated, so the arm's inertia is felt.
        none = [0.0] * self._n_moving
        model = self.client.calculateInverseDynamics(
            self.body,
            self._all_joints(q, measured=True),
            none if guided else self._all_joints(qd),
            none if guided else self._all_joints(wanted),
        )
        torque = np.array(model)[self._columns] + limit_torque(self.gains, self._free, q, qd)
        if guided:
            torque += guiding_torque(self.gains, qd)
        elif law is None:
            ref = self.reference
            torque += impedance_torque(self.gains, q, qd, ref.position, ref.velocity)
        if self._payload_mass_kg > 0.0:
            torque += self._payload_torque()
        bound = self.limits.torque
        self._torque = np.minimum(np.maximum(torque, -bound), bound)
        forces = self._torque.tolist()
        if forces != torque.tolist():
            self.saturated_steps += 1
        self.client.setJointMotorControlArray(
            self.body, self.joint_indices, pybullet.TORQUE_CONTROL, forces=forces
        )

    def _payload_torque(self) -> Floats:
        zeros = [0.0] * self._n_moving
        q = self._all_joints(self._q, measured=True)
        linear, _ = self.client.calculateJacobian(
            self.body, self.hand_link, self._payload_com_m, q, zeros, zeros
        )
        return np.array(linear[2])[self._columns] * (self._payload_mass_kg * GRAVITY_M_S2)

    def _all_joints(self, values: Floats, measured: bool = False) -> list[float]:
        """Values of all moving joints in PyBullet's order, from those of the chain (n,)."""
        if not self._other_columns:
            return values[self._order].tolist()
        every = np.zeros(self._n_moving)
        every[self._columns] = values
        if measured:
            every[self._other_columns] = self.others.positions()
        return every.tolist()

    def _apply_pushes(self) -> None:
        self._pushes = [push for push in self._pushes if self.n_steps < push.until_step]
        for push in self._pushes:
            link = self.client.getLinkState(self.body, push.link)
            point, _ = self.client.multiplyTransforms(
                link[4], link[5], push.point, (0.0, 0.0, 0.0, 1.0)
            )
            self.client.applyExternalForce(
                self.body, push.link, push.force, point, pybullet.WORLD_FRAME
            )

    def _read(self) -> None:
        states = self.client.getJointStates(self.body, self.joint_indices)
        q, qd, *_ = zip(*states, strict=True)
        self._q, self._qd = np.array(q), np.array(qd)

    def _joint_array(self, values: Floats | Sequence[float], argument: str) -> Floats:
        array, n = np.array(values, dtype=np.float64), self.robot.n_joints
        if array.shape != (n,):
            names = ", ".join(self.robot.joint_names)
            raise ShapeError.about(argument, f"shape ({n},): {names}", array.shape, "Give all.")
        if not np.isfinite(array).all():
            raise ArgumentError.about(argument, "finite values", array, "Check the source.")
        return array

# SPDX-License-Identifier: Apache-2.0
"""Any arm from its URDF: forward and inverse kinematics of a named chain, computed by pinocchio.

pinocchio is only imported when the first arm is made.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, KinematicsError, ShapeError, optional
from intent_recognition.kinematics.following import FollowedPath, follow
from intent_recognition.kinematics.limits import JointLimits, check_position
from intent_recognition.kinematics.links import Links, ReducedModel
from intent_recognition.kinematics.lwr import DEFAULT_ACCELERATION_RAD_S2
from intent_recognition.kinematics.pose_search import REACHED, PoseSearch, Solution, checked_target
from intent_recognition.kinematics.urdf import UrdfChain, read_chain
from intent_recognition.kinematics.urdf_tree import LINK


class Arm:
    """A chain of joints between two links of a URDF; make it with `from_urdf`.

    Joint vectors have one value for each of `joint_names`, in that order [rad, or m for prismatic
    joints]. Poses are those of the link `tip` in the frame of the link `base`. An arm has internal
    buffers, so only one thread at a time may use it. Arrays that do not fit raise a `ShapeError`.

    Attributes:
        base: link in whose frame poses are given.
        tip: link whose pose is computed.
        joint_names: independent joints that move the tip, from the base on.
        limits: read from the URDF; continuous joints have +-1e6 rad.
        rest: posture toward which redundant joints are drawn (n,).
    """

    def __init__(self, chain: UrdfChain, rest: ArrayLike | None) -> None:
        self.base, self.tip = chain.base, chain.tip
        self.joint_names: tuple[str, ...] = chain.names
        self.limits: JointLimits = chain.limits
        self._continuous = np.array(chain.continuous)
        self._build(chain)
        middle = np.where(self._continuous, 0.0, 0.5 * (self.limits.lower + self.limits.upper))
        self.rest = self._vector(middle if rest is None else rest, "rest").copy()
        check_position(self.rest, self.limits, self.joint_names, "rest")
        self.rest.setflags(write=False)
        self._search = PoseSearch(
            self._pose_and_jacobian, self.limits.lower, self.limits.upper, self._continuous
        )

    @classmethod
    def from_urdf(
        cls,
        source: str | Path,
        *,
        base: str | None = None,
        tip: str | None = None,
        rest: ArrayLike | None = None,
        acceleration_rad_s2: float = DEFAULT_ACCELERATION_RAD_S2,
        beyond: bool = False,
    ) -> "Arm":
        """Read an arm; meshes are not needed. Joints outside the chain stay at zero.

        Args:
            source: path of a URDF or xacro file, or the text of a URDF.
            base: link at which the chain begins; the root by default.
            tip: link at which the chain ends; by default the end of the branch with the most
                joints, before its gripper.
            rest: posture toward which redundant joints are drawn (n,); by default the middle of the
                limits.
            acceleration_rad_s2: acceleration limit of every joint, which a URDF does not hold.
            beyond: whether joints after the tip, up to the default tip, belong to the arm; they do
                not move the tip, and stay near `rest`.

        Raises:
            ArgumentError: the source is no URDF, a link is unknown, no chain joins the links, there
                are several arms and no `tip`, or a joint lacks position limits.
        """
        return cls(read_chain(source, base, tip, acceleration_rad_s2, beyond), rest)

    @property
    def n_joints(self) -> int:
        """Number of independent joints."""
        return len(self.joint_names)

    def forward_kinematics(self, q: ArrayLike) -> Floats:
        """Poses of the tip in the base frame, (..., 4, 4), for q (..., n)."""
        q = self._vector(q, "q")
        flat = q.reshape(-1, self.n_joints)
        poses = np.array([self._pose(row) for row in flat]).reshape(-1, 4, 4)
        return poses.reshape(*q.shape[:-1], 4, 4)

    def skeleton(self, q: ArrayLike) -> Floats:
        """Origins of the joints from the base on, and of the tip, (T, k, 3) [m], for q (T, n)."""
        return self.moving_skeleton(q, np.zeros(np.shape(q)))[0]

    def moving_skeleton(self, q: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
        """`skeleton`, and the speeds (T, k) [m/s] of its points at velocities (T, n).

        No point on the lines between these points is faster than the fastest of them.
        """
        q, rates = (self._vector(a, "q").reshape(-1, self.n_joints) for a in (q, velocity))
        values = q @ self._reduced.drive.T + self._reduced.offset
        return self._links.moving_points(values, rates @ self._reduced.drive.T)

    def most_motion(
        self, velocity: Floats, acceleration: Floats, jerk: Floats
    ) -> tuple[Floats, Floats]:
        """Bounds on the speed and jerk of the skeleton, (T,) [m/s] and (T,) [m/s^3].

        They hold in any posture. The arguments bound those of the joints, (T, n) each. The
        derivative of a point by joint j is at most the lever of j, the length of the chain beyond
        it; further derivatives are at most the lever of the joint nearest to the tip.
        """
        drive, links = np.abs(self._reduced.drive), self._links
        v, a, j = (np.abs(rates) @ drive.T for rates in (velocity, acceleration, jerk))
        turned, changed = v * links.turns, a * links.turns
        before = np.cumsum(turned, axis=1) - turned
        changed_before = np.cumsum(changed, axis=1) - changed
        of_v = changed + changed_before + before**2 + before * turned + turned**2 / 3.0
        return v @ links.levers, (j + 3.0 * (v * of_v + a * before)) @ links.levers

    def jacobian(self, q: ArrayLike) -> Floats:
        """Geometric Jacobian (6, n) of the tip in base axes at q (n,): linear rows come first."""
        return self._pose_and_jacobian(self._one(q, "q"))[1]

    def inverse_dynamics(self, q: Floats, velocity: Floats, acceleration: Floats) -> Floats:
        """Torques (n,) [Nm] for a motion, from the URDF's inertias; gravity is along -z.

        Positions, velocities and accelerations of the joints are (n,) each.
        """
        q, *rates = (self._one(a, "q") for a in (q, velocity, acceleration))
        drive = self._reduced.drive
        driven = (drive @ rate for rate in rates)
        return drive.T @ self._pin.rnea(self._model, self._data, self._reduced.values(q), *driven)

    def inverse_kinematics(
        self, target: ArrayLike, seed: ArrayLike | None = None, rest: ArrayLike | None = None
    ) -> Floats:
        """Joint vector (n,) inside the limits that reaches a pose (4, 4) or a position (3,) [m].

        The search begins at the seed and stays on its branch if that leads to the target; otherwise
        it restarts from postures near the target. Of a redundant arm's solutions, it takes one near
        `rest` and away from singularities. `seed` and `rest` are the arm's `rest` by default.

        Raises:
            KinematicsError: no solution was found; the message gives the remaining distance.
        """
        found = self.nearest(target, seed, rest)
        if found.error > REACHED:
            expected = f"a pose that {self.tip} can reach within the joint limits"
            got = f"one missed by {found.distance_m:.4f} m and {found.angle_rad:.4f} rad"
            raise KinematicsError.about("target", expected, got, "Bring it nearer, or turn it.")
        return found.q

    def nearest(
        self, target: ArrayLike, seed: ArrayLike | None = None, rest: ArrayLike | None = None
    ) -> Solution:
        """The posture nearest to a pose (4, 4) or position (3,), and its distance from it.

        `seed` and `rest` are as in `inverse_kinematics`.
        """
        goal = checked_target(target)
        return self._search.solve(goal, self._start(seed), self._start(rest, "rest"))

    def follow(
        self, targets: ArrayLike, seed: ArrayLike | None = None, rest: ArrayLike | None = None
    ) -> FollowedPath:
        """Joint vectors along poses (T, 4, 4) or positions (T, 3): continuous, within the limits.

        For a target out of reach, the result holds the nearest posture and its distance from the
        target. `seed`, such as the measured posture, and `rest` are as in `inverse_kinematics`.
        """
        array = np.asarray(targets, dtype=np.float64)
        if len(array.shape) not in (2, 3) or len(array) == 0:
            expected = "poses (T, 4, 4) or positions (T, 3)"
            raise ShapeError.about("targets", expected, array.shape, "Give at least one.")
        goals = [checked_target(target) for target in array]
        return follow(self._search, goals, self._start(seed), self._start(rest, "rest"))

    def _start(self, q: ArrayLike | None, argument: str = "seed") -> Floats:
        return self.rest if q is None else self._one(q, argument)

    def _one(self, q: ArrayLike, argument: str) -> Floats:
        vector = self._vector(q, argument)
        if vector.ndim != 1:
            raise ShapeError.about(argument, f"({self.n_joints},)", vector.shape, "Give one.")
        return vector

    def _vector(self, q: ArrayLike, argument: str) -> Floats:
        array = np.asarray(q, dtype=np.float64)
        if array.ndim == 0 or array.shape[-1] != self.n_joints or not np.all(np.isfinite(array)):
            expected = f"(..., {self.n_joints}), finite: {', '.join(self.joint_names)}"
            raise ShapeError.about(argument, expected, array.shape, "Give one value per joint.")
        return array

    def _build(self, chain: UrdfChain) -> None:
        """Build the model, reduced to the chain and the joints that copy its joints."""
        pin = self._pin = optional("pinocchio")
        try:
            full = pin.buildModelFromXML(chain.xml)
        except Exception as error:  # urdfdom raises plain C++ exceptions
            cure = "Check it with check_urdf."
            raise ArgumentError.about("robot", "a URDF", str(error), cure) from error
        self._reduced = ReducedModel.of(pin, full, chain.names, chain.mimics)
        self._model, self._data = self._reduced.model, self._reduced.model.createData()
        self._tip_frame = self._model.getFrameId(LINK + chain.tip)
        pin.framesForwardKinematics(self._model, self._data, self._reduced.offset)
        at = self._data.oMf[self._model.getFrameId(LINK + chain.base)]
        self._from_base = None if at.isIdentity() else at.inverse()
        self._links = Links.of(self._model, self._tip_frame, self._from_base)

    def _pose(self, q: Floats) -> Floats:
        values = self._reduced.values(q)
        self._pin.forwardKinematics(self._model, self._data, values)
        pose = self._pin.updateFramePlacement(self._model, self._data, self._tip_frame)
        return (pose if self._from_base is None else self._from_base * pose).homogeneous

    def _pose_and_jacobian(self, q: Floats) -> tuple[Floats, Floats]:
        pin, model, data = self._pin, self._model, self._data
        values = self._reduced.values(q)
        pin.computeJointJacobians(model, data, values)
        pose = pin.updateFramePlacement(model, data, self._tip_frame)
        J = pin.getFrameJacobian(model, data, self._tip_frame, pin.LOCAL_WORLD_ALIGNED)
        J = J.reshape(6, -1)  # a vector for a single joint
        if not self._reduced.direct:
            J = J @ self._reduced.drive
        if self._from_base is not None:
            pose, R = self._from_base * pose, self._from_base.rotation
            J = np.vstack([R @ J[:3], R @ J[3:]])
        return pose.homogeneous, J

# SPDX-License-Identifier: Apache-2.0
"""The two containers and the balls in the arm's world: one in its hand, one on a stand."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Flags, Floats
from intent_recognition.signals import homogeneous
from sim_bridge.arm import SimulatedArm
from sim_bridge.balls import (
    CONTACT_BREAKING_M,
    BallWorld,
    Hollow,
    WallGuard,
    add_balls,
    ball_mass_kg,
    hollow_of,
    settled,
    shell_pieces,
    solid_pieces,
    wall_pieces,
    write_obj,
)
from sim_bridge.containers import Container
from sim_bridge.physics import fix, pybullet
from sim_bridge.scenarios.pouring.task_space import OPENING_M, SideGrasp

CUP_MASS_KG = 0.25
"""Mass of an empty cup [kg]."""
OUTSIDE_LINK, OUTSIDE_GROUP = 0, 64
"""Link and collision group of a container's true outside, which only collides with the other
container's outside; balls collide with the container's base. Bullet requires a filter on both
sides, so all other bodies exclude this group."""


class PouringTable:
    """A cup of balls fixed in the arm's hand, and a second container.

    The arm must be at rest with the cup upright, and its base at the world's origin. It carries the
    weight of cup and balls from the start. Containers and balls stay until the arm's world ends.
    Balls that do not fit are left out. The centre of the second container's opening is at
    `opening_m` (3,), world.

    Attributes:
        second_pose: pose of the second container (4, 4), world.
    """

    def __init__(
        self,
        arm: SimulatedArm,
        cup: Container,
        second: Container,
        ball_radius_m: float,
        n_balls: int,
        rng: np.random.Generator,
        opening_m: Floats = OPENING_M,
    ) -> None:
        self._arm, self._client = arm, arm.client
        self._radius_m = ball_radius_m
        self.grasp = SideGrasp(cup.lip_point, cup.height_m)
        self.cup, self.second = hollow_of(cup), hollow_of(second)
        self._client.setPhysicsEngineParameter(
            contactBreakingThreshold=CONTACT_BREAKING_M,
            numSolverIterations=15,  # more than for balls alone, since a cup hangs on the arm
        )
        pose = _pose_of(*arm.hand_pose()) @ self.grasp.cup_in_hand
        self._cup_body = self._container(self.cup, solid_pieces(cup), CUP_MASS_KG, pose)
        self.second_pose = stand = homogeneous(np.eye(3), opening_m - second.opening_centre)
        self._second_body = self._container(self.second, shell_pieces(second), 0.0, stand)
        self._client.setCollisionFilterPair(self._cup_body, self._second_body, -1, -1, 0)
        for link in range(-1, self._client.getNumJoints(arm.body)):
            self._client.setCollisionFilterPair(arm.body, self._cup_body, link, -1, 0)
            self._pass_outsides(arm.body, link)
        fix(self._client, self._cup_body, arm.body, arm.hand_link)
        with BallWorld(self.cup, ball_radius_m) as world:
            inside = settled(world, n_balls, rng)
        shape = self._client.createCollisionShape(pybullet.GEOM_SPHERE, radius=ball_radius_m)
        places = inside @ pose[:3, :3].T + pose[:3, 3]
        self._balls = add_balls(self._client, shape, ball_radius_m, places, 0.05)
        for ball in self._balls:
            self._pass_outsides(ball)
        self._in_cup = np.ones(len(inside), dtype=bool)
        self._cup_guard = WallGuard(self.cup, ball_radius_m, inside)
        self._second_guard = WallGuard(self.second, ball_radius_m, self._from(stand))
        self._carry(len(inside))

    @property
    def n_balls(self) -> int:
        """Number of balls."""
        return len(self._balls)

    @property
    def through_wall(self) -> int:
        """Number of balls that have gone into or through a wall."""
        return self._cup_guard.count + self._second_guard.count

    def cup_pose(self) -> Floats:
        """True pose of the cup (4, 4), world."""
        position, orientation = self._client.getBasePositionAndOrientation(self._cup_body)
        return _pose_of(np.array(position), np.array(orientation))

    def touch_n(self) -> float:
        """Force with which the cup's outside presses on the second container's [N]."""
        contacts = self._client.getContactPoints(
            self._cup_body, self._second_body, OUTSIDE_LINK, OUTSIDE_LINK
        )
        return float(sum(contact[9] for contact in contacts))

    def look(self) -> tuple[Flags, Flags]:
        """Whether each ball is in the cup, and whether it is in the second container, (N,) each.

        Call this every few milliseconds: it also updates the weight that the arm compensates.
        """
        in_cup = self._cup_guard.look(self._from(self.cup_pose()))
        in_second = self._second_guard.look(self._from(self.second_pose))
        if in_cup.sum() != self._in_cup.sum():
            self._carry(int(in_cup.sum()))
        self._in_cup = in_cup
        return in_cup, in_second

    def _from(self, pose: Floats) -> Floats:
        locate = self._client.getBasePositionAndOrientation
        world = np.array([locate(ball)[0] for ball in self._balls]).reshape(-1, 3)
        return (world - pose[:3, 3]) @ pose[:3, :3]

    def _container(
        self, hollow: Hollow, outside: list[Floats], mass_kg: float, pose: Floats
    ) -> int:
        client = self._client
        with TemporaryDirectory(prefix="pouring_") as folder:
            shapes = []
            for name, pieces in (("walls", wall_pieces(hollow)), ("outside", outside)):
                path = Path(folder) / f"{name}.obj"
                write_obj(pieces, path)
                shape = client.createCollisionShape(pybullet.GEOM_MESH, fileName=str(path))
                shapes.append(shape)
            body = client.createMultiBody(
                mass_kg,
                shapes[0],
                basePosition=pose[:3, 3].tolist(),
                baseOrientation=Rotation.from_matrix(pose[:3, :3]).as_quat().tolist(),
                linkMasses=[1e-3 if mass_kg else 0.0],  # too small to matter
                linkCollisionShapeIndices=[shapes[1]],
                linkVisualShapeIndices=[-1],
                linkPositions=[(0.0, 0.0, 0.0)],
                linkOrientations=[(0.0, 0.0, 0.0, 1.0)],
                linkInertialFramePositions=[(0.0, 0.0, 0.0)],
                linkInertialFrameOrientations=[(0.0, 0.0, 0.0, 1.0)],
                linkParentIndices=[0],
                linkJointTypes=[pybullet.JOINT_FIXED],
                linkJointAxis=[(0.0, 0.0, 1.0)],
            )
        client.setCollisionFilterGroupMask(body, OUTSIDE_LINK, OUTSIDE_GROUP, OUTSIDE_GROUP)
        self._pass_outsides(body)
        for link in (-1, OUTSIDE_LINK):
            client.changeDynamics(
                body,
                link,
                lateralFriction=0.0,
                restitution=0.0,
                linearDamping=0.0,
                angularDamping=0.0,
            )
        return body

    def _pass_outsides(self, body: int, link: int = -1) -> None:
        self._client.setCollisionFilterGroupMask(body, link, 1, ~OUTSIDE_GROUP)

    def _carry(self, n_balls: int) -> None:
        """Let the arm compensate cup and balls as a mass in the middle of the cup."""
        middle = np.array([0.0, 0.0, 0.5 * self.grasp.height_m, 1.0])
        centre = (self.grasp.cup_in_hand @ middle)[:3]
        self._arm.set_payload(CUP_MASS_KG + n_balls * ball_mass_kg(self._radius_m), tuple(centre))


def _pose_of(position: Floats, quaternion: Floats) -> Floats:
    return homogeneous(Rotation.from_quat(quaternion).as_matrix(), position)

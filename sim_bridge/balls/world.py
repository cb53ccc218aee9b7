# SPDX-License-Identifier: Apache-2.0
"""A PyBullet world with one fixed container and balls; gravity may point anywhere."""

from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge import GRAVITY_M_S2
from sim_bridge.balls.collision import wall_pieces, write_obj
from sim_bridge.balls.hollow import Hollow

STEP_S = 1.0 / 240.0
"""Physics step [s], the default of PyBullet."""
DENSITY_KG_M3 = 1000.0
"""Density of the balls [kg/m^3], that of water."""
CONTACT_BREAKING_M = 0.001
"""Distance [m] at which Bullet drops a contact; its default of 20 mm is slower."""
SOLVER_ITERATIONS = 10
"""Iterations of the contact solver; balls overlap by up to 12 % of their diameter
(docs/pouring.md)."""
PACKING = 0.6
"""Share of the space that settled balls fill."""


class BallWorld(AbstractContextManager["BallWorld"]):
    """One container, fixed at the origin in its own frame, and balls of one size.

    Balls in maximal coordinates and a small contact threshold make it three times faster than
    Bullet's defaults. Use it as a context manager; leaving it ends the world.
    """

    def __init__(self, hollow: Hollow, ball_radius_m: float) -> None:
        # Loaded late, so that reading trials does not need physics.
        from sim_bridge.physics import start_world

        self.hollow = hollow
        self.ball_radius_m = ball_radius_m
        self._folder = TemporaryDirectory(prefix="balls_")
        self._walls = Path(self._folder.name) / "walls.obj"
        write_obj(wall_pieces(hollow), self._walls)
        self.client = start_world()
        self._balls: list[int] = []
        self.fill(np.zeros((0, 3)))

    def fill(self, positions_m: Floats) -> None:
        """Start a new world with balls at rest at (N, 3).

        A new world makes a trial depend on its own input only; `restoreState` is not exact.
        """
        client = self.client
        client.resetSimulation()
        client.setTimeStep(STEP_S)
        client.setPhysicsEngineParameter(
            contactBreakingThreshold=CONTACT_BREAKING_M, numSolverIterations=SOLVER_ITERATIONS
        )
        shape = client.createCollisionShape(client.GEOM_MESH, fileName=str(self._walls))
        walls = client.createMultiBody(0.0, shape)
        client.changeDynamics(walls, -1, lateralFriction=0.0, restitution=0.0)  # balls flow
        self._sphere = client.createCollisionShape(client.GEOM_SPHERE, radius=self.ball_radius_m)
        self._balls = []
        self.set_gravity(np.array([0.0, 0.0, -1.0]))
        self.add(positions_m)

    def add(self, positions_m: Floats, velocities_m_s: Floats | None = None) -> None:
        """Add balls at (N, 3), at rest or moving (N, 3)."""
        added = add_balls(self.client, self._sphere, self.ball_radius_m, positions_m)
        moving = [] if velocities_m_s is None else velocities_m_s.tolist()
        for ball, velocity in zip(added, moving, strict=False):
            self.client.resetBaseVelocity(ball, velocity, [0.0] * 3)
        self._balls += added

    def set_gravity(self, direction: Floats) -> None:
        """Set the direction of gravity, a unit vector (3,) in the container's frame."""
        x, y, z = (GRAVITY_M_S2 * direction).tolist()
        self.client.setGravity(x, y, z)

    def step(self, n_steps: int = 1) -> None:
        """Advance by n_steps of 1/240 s."""
        for _ in range(n_steps):
            self.client.stepSimulation()

    def positions_m(self) -> Floats:
        """Centres of the balls (N, 3) in the container's frame."""
        pose = self.client.getBasePositionAndOrientation
        return np.array([pose(ball)[0] for ball in self._balls]).reshape(-1, 3)

    def velocities_m_s(self) -> Floats:
        """Velocities of the balls (N, 3) in the container's frame."""
        twist = self.client.getBaseVelocity
        return np.array([twist(ball)[0] for ball in self._balls]).reshape(-1, 3)

    def close(self) -> None:
        """End the world."""
        from sim_bridge.physics import end_world

        end_world(self.client)
        self._folder.cleanup()

    def __exit__(self, *_: object) -> None:
        self.close()


def ball_mass_kg(radius_m: float) -> float:
    """Mass of a ball of water [kg]."""
    return DENSITY_KG_M3 * 4.0 / 3.0 * np.pi * radius_m**3


def add_balls(
    client: Any, sphere: int, radius_m: float, positions_m: Floats, damping: float = 0.0
) -> list[int]:
    """Put balls at rest into a world at (N, 3), with Bullet's linear damping; return bodies."""
    balls = []
    for place in positions_m.tolist():
        mass = ball_mass_kg(radius_m)
        ball = client.createMultiBody(mass, sphere, basePosition=place, useMaximalCoordinates=1)
        still = {"restitution": 0.0, "linearDamping": damping, "angularDamping": 0.0}
        client.changeDynamics(ball, -1, lateralFriction=0.0, **still)
        balls.append(ball)
    return balls


def ball_radius_m(volume_m3: float, n_full: int) -> float:
    """Radius with which `n_full` balls fill a volume."""
    return float((3.0 * PACKING * volume_m3 / (4.0 * np.pi * n_full)) ** (1.0 / 3.0))


def balls_in(volume_m3: float, ball_radius_m: float) -> float:
    """Number of balls of a radius that fill a volume."""
    return float(3.0 * PACKING * volume_m3 / (4.0 * np.pi * ball_radius_m**3))


def settled(world: BallWorld, n_balls: int, rng: np.random.Generator) -> Floats:
    """Fill the world's container and let the balls come to rest.

    Returns:
        Centres (N, 3) of the balls in the container, the lowest first; N <= n_balls, without balls
        that fell beside it.
    """
    world.fill(_layers(world.hollow, world.ball_radius_m, n_balls, rng))
    world.step(240)  # one second
    positions = world.positions_m()
    inside = positions[world.hollow.holds(positions)]
    return inside[np.argsort(inside[:, 2])]


def _layers(hollow: Hollow, radius_m: float, n_balls: int, rng: np.random.Generator) -> Floats:
    """Ball centres (n_balls, 3) in layers from the floor up, without overlaps."""
    pitch = 2.02 * radius_m
    reach = np.max(np.abs(hollow.rings_m))
    places, height = np.zeros((0, 3)), hollow.heights_m[0] + 1.1 * radius_m
    while len(places) < n_balls:
        shift = rng.uniform(0.0, pitch, 2)
        axes = (np.arange(-reach, reach + pitch, pitch) + part for part in shift)
        layer = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        layer = np.column_stack([layer, np.full(len(layer), height)])
        # Above the rim the balls stand in a column over the opening.
        layer = layer[hollow.clearance_m(layer) > 1.15 * radius_m]
        places = np.concatenate([places, rng.permutation(layer)])
        height += pitch
    return places[:n_balls]

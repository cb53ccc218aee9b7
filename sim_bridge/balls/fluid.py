# SPDX-License-Identifier: Apache-2.0
"""Balls as a fluid: how many fill a container, and settled fills of any amount."""

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge.balls.hollow import Hollow
from sim_bridge.balls.world import BallWorld
from sim_bridge.containers import Container

PACKING = 0.6
"""Share of the space that settled balls take up."""

N_HEIGHTS, N_CORNERS = 7, 32
"""Heights at which the inner outline is taken, and corners of each. Convention."""


def hollow_of(container: Container) -> Hollow:
    """The inner wall of a container in fewer rings and corners, crest included."""
    sections = container.sections
    body = len(sections.heights_m) - 1
    wanted = np.linspace(sections.heights_m[0], sections.heights_m[-2], N_HEIGHTS - 1)
    rows = {int(np.argmin(np.abs(sections.heights_m[:body] - height))) for height in wanted}
    chosen = [*sorted(rows), body]
    every = sections.inner.shape[1] // N_CORNERS
    return Hollow(sections.inner[chosen][:, ::every], sections.heights_m[chosen])


def ball_radius_m(volume_m3: float, n_full: int) -> float:
    """Radius of balls of which `n_full` fill a volume."""
    return float((3.0 * PACKING * volume_m3 / (4.0 * np.pi * n_full)) ** (1.0 / 3.0))


def balls_in(volume_m3: float, ball_radius_m: float) -> float:
    """How many balls of a radius fill a volume."""
    return float(3.0 * PACKING * volume_m3 / (4.0 * np.pi * ball_radius_m**3))


def settled(world: BallWorld, n_balls: int, rng: np.random.Generator) -> Floats:
    """Fill the world's container anew, let the balls come to rest, and leave out what fell beside.

    Returns:
        Centres (N, 3) of the balls that are in it, the lowest first, N <= n_balls.
    """
    world.fill(_layers(world.hollow, world.ball_radius_m, n_balls, rng))
    world.step(240)  # one second
    positions = world.positions_m()
    inside = positions[world.hollow.holds(positions)]
    return inside[np.argsort(inside[:, 2])]


def _layers(hollow: Hollow, radius_m: float, n_balls: int, rng: np.random.Generator) -> Floats:
    """Places (n_balls, 3) in layers from the floor up, none in another or in the wall."""
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

# SPDX-License-Identifier: Apache-2.0
"""The trials of the two experiments in blocks, each block a function of (seed, what, index) alone.

Source: Brandl et al. 2014, section IV-A.
"""

from dataclasses import dataclass

import numpy as np

from experiments.constraints.catching import catch, tilt
from intent_recognition.array_types import Floats
from sim_bridge.balls import BallWorld, ball_radius_m, balls_in, hollow_of, settled
from sim_bridge.containers import CONTAINER_NAMES, CONTAINER_SEED, Container, make_container

TRIALS_PER_OBJECT = 1000
"""Trials of each kind with each container; a classifier learns from 50 of them."""
TRIALS_PER_BLOCK = 50
"""Trials that a process makes before they are written to a file."""

BALLS_FULL = 60
"""Balls that fill a container in the pouring trials; they are smaller for a smaller cup."""
FILL_SHARE = (0.05, 0.95)
"""Least and greatest share of the volume that is filled."""
TILT_MAX_RAD = np.pi / 2.0
"""Greatest tilt of a pouring trial [rad]."""

SECOND = "tea_cup"
"""The second container of the filling trials; it remains the same, as in the paper."""
BALLS_POURED = 10
"""Balls of a filling trial."""
POURED_RADIUS_M = 0.008
"""Radius of the balls of a filling trial [m]."""
SECOND_BALLS_MAX = 55
"""Most balls in the second container before a filling trial."""
FILLING_TILT_RAD = np.deg2rad(120.0)
"""Tilt of every filling trial [rad]: all balls leave."""
FILLING_HOLD_S = 0.8
"""How long that tilt is held [s]."""
PLACES_PER_POUR = 5
"""Places for each pour: what leaves the first container does not depend on the second."""
LIP_ALONG_RADII = (-2.25, 0.25)
"""Where the lip is along the direction of pouring, in radii of the second opening."""
LIP_ACROSS_RADII = (-0.8, 0.8)
"""Where the lip is across that direction, in the same radii."""
LIP_ABOVE_M = (0.01, 0.10)
"""Height of the lip above the second opening [m]."""

POURING, FILLING = "pouring", "filling"
"""The two kinds of trials."""
COLUMNS = {
    POURING: ("object", "fluid_m3", "tilt_rad", "poured", "through_wall"),
    FILLING: (
        "object", "fluid_m3", "second_fluid_m3", "lip_x_m", "lip_y_m", "lip_z_m", "poured",
        "success", "through_wall",
    ),
}  # fmt: skip
"""Columns of each experiment's table; `object` is the index in CONTAINER_NAMES."""


@dataclass(frozen=True)
class TrialBlock:
    """Trials that are made together: one object, from one seed."""

    seed: int
    experiment: str
    object_index: int
    index: int
    n_trials: int = TRIALS_PER_BLOCK

    @property
    def name(self) -> str:
        """Such as pouring_mug_03."""
        return f"{self.experiment}_{CONTAINER_NAMES[self.object_index]}_{self.index:02d}"

    def rng(self) -> np.random.Generator:
        """All that is random in the block."""
        experiment = (POURING, FILLING).index(self.experiment)
        return np.random.default_rng([self.seed, experiment, self.object_index, self.index])


def blocks(seed: int, trials_per_object: int = TRIALS_PER_OBJECT) -> list[TrialBlock]:
    """All blocks, in turn over experiments and objects, so that an unfinished run is balanced."""
    numbers = range(-(-trials_per_object // TRIALS_PER_BLOCK))
    return [
        TrialBlock(
            seed, experiment, k, index,
            min(TRIALS_PER_BLOCK, trials_per_object - index * TRIALS_PER_BLOCK),
        )
        for index in numbers
        for experiment in (POURING, FILLING)
        for k in range(len(CONTAINER_NAMES))
    ]  # fmt: skip


def make(block: TrialBlock) -> Floats:
    """Run a block: (n_trials, len(COLUMNS[experiment])) float64."""
    return (pouring_block if block.experiment == POURING else filling_block)(block)


def container(index: int) -> Container:
    """The container of an object index."""
    return make_container(CONTAINER_NAMES[index], CONTAINER_SEED)


def pouring_block(block: TrialBlock) -> Floats:
    """Tilt one container by random angles with random amounts in it.

    The balls settle once, full; every trial takes the lowest of them.
    """
    rng, cup = block.rng(), container(block.object_index)
    radius = ball_radius_m(cup.inner_volume_m3, BALLS_FULL)
    rows = []
    with BallWorld(hollow_of(cup), radius) as world:
        full = settled(world, BALLS_FULL, rng)
        for _ in range(block.n_trials):
            count = min(round(rng.uniform(*FILL_SHARE) * BALLS_FULL), len(full))
            angle = rng.uniform(0.0, TILT_MAX_RAD)
            result = tilt(world, full[:count], angle)
            rows.append(
                (block.object_index, count / balls_in(1.0, radius), angle, result.left.sum(),
                 result.through_wall)
            )  # fmt: skip
    return np.array(rows, dtype=np.float64)


def filling_block(block: TrialBlock) -> Floats:
    """Pour ten balls from one container at random places over the second one."""
    rng, cup = block.rng(), container(block.object_index)
    second = make_container(SECOND, CONTAINER_SEED)
    rows = []
    with (
        BallWorld(hollow_of(cup), POURED_RADIUS_M) as first_world,
        BallWorld(hollow_of(second), POURED_RADIUS_M) as second_world,
    ):
        ten = settled(first_world, BALLS_POURED, rng)
        full = settled(second_world, SECOND_BALLS_MAX, rng)
        for trial in range(block.n_trials):
            if trial % PLACES_PER_POUR == 0:
                jitter = 1e-4 * rng.standard_normal(ten.shape)
                poured = tilt(first_world, ten + jitter, FILLING_TILT_RAD, hold_s=FILLING_HOLD_S)
            count = int(rng.integers(0, len(full) + 1))
            lip = _place(rng, second)
            caught = catch(second_world, full[:count], poured, lip + second.opening_centre)
            rows.append(
                (block.object_index, len(ten) / balls_in(1.0, POURED_RADIUS_M),
                 count / balls_in(1.0, POURED_RADIUS_M), *lip, poured.left.sum(), caught.success,
                 poured.through_wall + caught.through_wall)
            )  # fmt: skip
    return np.array(rows, dtype=np.float64)


def _place(rng: np.random.Generator, second: Container) -> Floats:
    """Where the lip is, from the centre of the second opening (3,) [m]."""
    radius = second.opening_radius_m
    along, across = rng.uniform(*LIP_ALONG_RADII), rng.uniform(*LIP_ACROSS_RADII)
    return np.array([along * radius, across * radius, rng.uniform(*LIP_ABOVE_M)])

# SPDX-License-Identifier: Apache-2.0
"""The 28 demonstrations beside the pole: 14 on each side, nine spots on both.

The recordings carry no task. On which side the arm was led stands in their metadata, for scoring
alone; the learner does not read it.
"""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from experiments.pole.geometry import HOME, LEFT, RIGHT, WAYS, fingertip, way_of
from experiments.pole.lesson import PoleLesson, lead_around
from experiments.pole.person import WandPointing, draw_pointing
from experiments.pole.plan import can_reach, plan_way
from experiments.recording import (
    Content,
    known_of,
    metadata_stamp,
    metadata_vector,
    pose_and_joint_messages,
    recorded_at_ns,
)
from experiments.teaching.path import REACTION_SHARE
from intent_recognition.array_types import Floats
from intent_recognition.errors import KinematicsError

WAND_TOPIC = "mocap/wand/pose"
DEPTHS_M = (0.53, 0.57, 0.61)
"""Distances of the middle spots from the robot [m]."""
BOTH_WAYS_Y_M = (-0.06, 0.0, 0.06)
"""Their places to the left of the middle [m]: both ways reach them."""
ONE_WAY_Y_M = (0.15, 0.18, 0.15, 0.20, 0.17)
"""How far the other spots are to the side [m]: only one way reaches them."""
ONE_WAY_X_M = (0.52, 0.55, 0.57, 0.60, 0.62)
"""Their distances from the robot [m]."""
JITTER_M = 0.01
"""Spots are moved by up to so much per axis [m]."""
START_STD_RAD = 0.004
"""Scatter of the arm's posture at the start per joint [rad]."""
SWING_STD_RAD = 0.03
"""Scatter of the posture it swings by per joint [rad]."""
AIM_STD_M = 0.004
"""Scatter of the demonstrator's aim at a spot per axis [m]."""
TOUCH_M = 0.01
"""A demonstration that comes nearer to the pole is shown again [m]."""
ATTEMPTS = 20
"""Most attempts at one demonstration."""
_STREAM = 31
"""Keeps this scenario's random numbers apart from those of others with the same seed."""


@dataclass(frozen=True)
class PoleOrder:
    """One demonstration to make."""

    seed: int
    index: int
    spot: int
    way: str

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath("pole", f"pole_{self.index:02d}")

    @property
    def start_ns(self) -> int:
        """Stamp of the first sample: one demonstration a minute."""
        return recorded_at_ns(20_000 + self.index)


@dataclass(frozen=True)
class PoleDemonstration:
    """One demonstration: the person, the arm, and how often it had to be tried."""

    order: PoleOrder
    pointing: WandPointing
    lesson: PoleLesson
    reachable: tuple[str, ...]
    attempts: int


def spot_positions(seed: int) -> Floats:
    """The spots on the table (19, 2): nine in the middle, five on the left, five on the right."""
    middle = [(x, y) for x in DEPTHS_M for y in BOTH_WAYS_Y_M]
    left = list(zip(ONE_WAY_X_M, ONE_WAY_Y_M, strict=True))
    right = [(x, -y) for x, y in left]
    jitter = np.random.default_rng([seed, _STREAM, 0]).uniform(-JITTER_M, JITTER_M, (19, 2))
    return np.array(middle + left + right) + jitter


def orders(seed: int) -> list[PoleOrder]:
    """Every demonstration; those of one spot by both ways do not follow each other."""
    ways = [(spot, LEFT) for spot in (*range(9), *range(9, 14))]
    ways += [(spot, RIGHT) for spot in (*range(9), *range(14, 19))]
    dealt = np.random.default_rng([seed, _STREAM, 1]).permutation(len(ways))
    return [PoleOrder(seed, index, *ways[k]) for index, k in enumerate(dealt)]


def demonstrate(order: PoleOrder) -> PoleDemonstration:
    """Simulate one demonstration; one that comes too near the pole is shown again.

    Raises:
        KinematicsError: it cannot be shown.
    """
    spot = spot_positions(order.seed)[order.spot]
    rng = np.random.default_rng([order.seed, _STREAM, 2, order.index])
    for attempt in range(ATTEMPTS):
        pointing = draw_pointing(rng, spot, order.way)
        start = HOME + START_STD_RAD * rng.standard_normal(7)
        error = SWING_STD_RAD * rng.standard_normal(7)
        aimed = spot + AIM_STD_M * rng.standard_normal(2)
        try:
            way = plan_way(aimed, order.way, start=start, swing_error_rad=error)
        except KinematicsError:
            continue
        begin = pointing.onset_s + REACTION_SHARE * (pointing.arrival_s - pointing.onset_s)
        lesson = lead_around(rng, way, begin, pointing.arrival_s, len(pointing.samples.times_s))
        path = fingertip(lesson.true_positions_rad)
        if lesson.clearance_m.min() > TOUCH_M and way_of(path) == order.way:
            reachable = tuple(way for way in WAYS if can_reach(spot, way))
            return PoleDemonstration(order, pointing, lesson, reachable, attempt + 1)
    raise KinematicsError.about(
        f"spot {np.round(spot, 3).tolist()}",
        f"a demonstration by the {order.way} of the pole",
        f"none in {ATTEMPTS} attempts",
        "Move the spot.",
    )


def metadata(shown: PoleDemonstration) -> dict[str, str]:
    """Entries of metadata.yaml under custom_data, without a task."""
    order, pointing, lesson = shown.order, shown.pointing, shown.lesson

    missed = fingertip(lesson.true_positions_rad[-1])[:2] - pointing.reach.goal_m[:2]
    return {
        **known_of(order.seed, order.index),
        "way": order.way,
        "spot": str(order.spot),
        "reachable": " ".join(shown.reachable),
        "attempts": str(shown.attempts),
        "human_onset_ns": metadata_stamp(order.start_ns, pointing.onset_s),
        "human_end_ns": metadata_stamp(order.start_ns, pointing.end_s),
        "robot_arrival_ns": metadata_stamp(order.start_ns, pointing.arrival_s),
        "goal_m": metadata_vector(pointing.reach.goal_m),
        "clearance_m": f"{lesson.clearance_m.min():.6f}",
        "teaching_error_m": f"{np.linalg.norm(missed):.6f}",
        "strongest_pull_n": f"{lesson.strongest_pull_n:.3f}",
    }


def content(order: PoleOrder, _: Path) -> Content:
    """Simulate one recording: its metadata and its messages."""
    shown = demonstrate(order)
    said = pose_and_joint_messages(order.start_ns, shown.pointing.samples, shown.lesson, WAND_TOPIC)
    return metadata(shown), said

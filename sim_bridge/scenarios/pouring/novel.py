# SPDX-License-Identifier: Apache-2.0
"""Pouring with containers that were not demonstrated: scanning, learning and planning.

The primitive is learned with one pair of containers. Another pair is scanned, and its warped
parameters rescale a path of the primitive.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.bags import BagReader
from intent_recognition.errors import BagError
from intent_recognition.kinematics import forward_kinematics
from intent_recognition.objects import find_object, load_object
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.warping import (
    Emptying,
    ObjectCloud,
    ObjectModel,
    PouringSkill,
    Reached,
    References,
    WarpedPrimitive,
    emptying,
    from_warped,
    pouring_parameters,
    reached,
    tilts_to_level,
    to_warped,
    warp_object,
)
from sim_bridge.balls import ball_radius_m
from sim_bridge.containers import (
    CONTAINER_NAMES,
    CONTAINER_SEED,
    SHAPES,
    Container,
    build_container,
    make_container,
    scan,
)
from sim_bridge.scenarios.pouring.task_space import PourPath, SideGrasp, seen_path

TASK = "pouring"
N_BALLS = 40
"""Number of balls that fill half of a cup."""
BIG_BOWL, BIG_BOWL_SCALE = "big_bowl", 1.5
PAIRS = (
    ("espresso_cup", BIG_BOWL),
    ("mug", "tumbler"),
    ("tumbler", "square_bowl"),
    ("tall_glass", "round_bowl"),
    ("paper_cup", "mug"),
    ("espresso_cup", "tea_cup"),
    ("tea_cup", "paper_cup"),
    ("espresso_cup", "espresso_cup"),
    ("round_bowl", BIG_BOWL),
)
"""Pairs of cup and second container: pours into larger bowls, smaller cups and a square bowl, and
from the tallest, the smallest and a wide container."""


def half_full_radius_m(cup: Container) -> float:
    """Radius of balls of which `N_BALLS` fill half of a container."""
    return ball_radius_m(0.5 * cup.inner_volume_m3, N_BALLS)


def container_named(name: str) -> Container:
    """One of the ten containers, or the bowl that is larger than all of them."""
    if name != BIG_BOWL:
        return make_container(name, CONTAINER_SEED)
    small, scale = SHAPES["round_bowl"], BIG_BOWL_SCALE
    lengths = {f: scale * getattr(small, f) for f in ("height_m", "base_m", "top_m")}
    return build_container(BIG_BOWL, replace(small, **lengths))


JOINT_TOPIC = "joint_states"

BALLS_ABOVE = 1.7
"""Height to which balls rise above the lip before they leave, in radii. With it, the content of a
container at a tilt is predicted to 6 of 80 balls (root mean square of eight tilted containers)."""
HALF_FULL = 0.5
"""Share of the volume in the cup before a pour."""


class Seen(NamedTuple):
    """Parameters of one container, estimated from a scan.

    `references` divide paths; lip and centre of the opening (3,) are in the container's frame.
    """

    references: References
    lip_m: Floats
    opening_m: Floats
    emptying: Emptying


class PourLevel(NamedTuple):
    """How far a pour empties the cup: demonstrated extent, the cup's content at each tilt, amounts.

    `fluid` is the initial content and `left` the content to be left, as shares of the cup's volume.
    """

    far: Reached
    cup: Emptying
    fluid: float
    left: float


class DemonstratedPours(NamedTuple):
    """Recorded demonstrations: n pours, and the names of the two containers."""

    pours: Sequence[PourPath]
    cup: str
    second: str


@cache
def annotated_source() -> ObjectModel:
    """The annotated object with its classifier and frame, ready to be warped onto others."""
    return ObjectModel.learn(load_object(find_object("mug")))


def read_pour(folder: Path) -> tuple[PourPath, dict[str, str]]:
    """Read a pour from a bag's joint states, with the bag's labels.

    Raises:
        BagError: the bag holds no recorded pour.
    """
    reader = BagReader(folder)
    stamps_ns, postures = [], []
    for recorded in reader.messages([JOINT_TOPIC]):
        joint_state: Any = recorded.message
        stamps_ns.append(recorded.stamp_ns)
        postures.append(joint_state.position)
    stamps = np.array(stamps_ns)
    labels = reader.custom_data
    if len(stamps) < 2 or not {"cup", "second"} <= labels.keys():
        expected = f"{JOINT_TOPIC}, and cup and second among the labels"
        got = f"{len(stamps)} messages, labels {', '.join(sorted(labels)) or 'none'}"
        raise BagError.about(str(folder), expected, got, "Give a recorded pour.")
    times = (stamps - stamps[0]) * 1e-9
    return pour_of(times, np.array(postures), labels), labels


def read_demonstrated(folder: Path) -> DemonstratedPours:
    """Read all demonstrations below a folder, all with the same pair of containers.

    Raises:
        BagError: there are no demonstrations.
    """
    found = [read_pour(path.parent) for path in sorted(folder.glob("*/metadata.yaml"))]
    if not found:
        cure = "Name a folder of recorded pours."
        raise BagError.about(str(folder), "a folder of bags", "none in it", cure)
    labels = found[0][1]
    return DemonstratedPours([pour for pour, _ in found], labels["cup"], labels["second"])


def learn_pouring(pours: Sequence[PourPath], cup: Seen, second: Seen) -> PouringSkill:
    """Learn the skill in the warped space from pours with one pair of containers."""
    paths = [
        to_warped(pour.offset_m, pour.tilt_rad, cup.references, second.references) for pour in pours
    ]
    durations = [float(pour.times_s[-1]) for pour in pours]
    primitive = WarpedPrimitive.learn(paths, durations, NormalizedRBFBasis(30))
    tilts = primitive.mean_path(np.linspace(0.0, 1.0, 400))[:, 3]
    return PouringSkill(primitive, reached(tilts, cup.references.tilt_rad, cup.emptying))


def plan(
    primitive: WarpedPrimitive,
    cup: References,
    second: References,
    rng: np.random.Generator | None = None,
    level: PourLevel | None = None,
) -> PourPath:
    """Plan a path of the lip for containers with these references: the mean, or drawn with `rng`.

    Without a level, the tilt is scaled by the cup's tilt reference alone.
    """
    count = round(primitive.duration_s / 0.05) + 1
    phase = np.linspace(0.0, 1.0, count)
    path = primitive.mean_path(phase) if rng is None else primitive.sample(phase, rng)
    offset, tilt = from_warped(path, cup, second)
    if level is not None:
        tilt = tilts_to_level(path[:, 3], *level)
    return PourPath(phase * primitive.duration_s, offset, tilt)


def pour_of(times_s: Floats, joints_rad: Floats, custom_data: Mapping[str, str]) -> PourPath:
    """The pour of recorded joint angles (T, 7) [rad], with the metadata of their bag."""

    def vector(name: str) -> Floats:
        return np.array([float(part) for part in custom_data[name].split()])

    grasp = SideGrasp(vector("lip_m"), float(custom_data["height_m"]))
    cup_poses = forward_kinematics(joints_rad) @ grasp.cup_in_hand
    return seen_path(times_s, cup_poses, grasp.lip_m, vector("opening_m"))


@cache
def seen_as(name: str, seed: int) -> Seen:
    """Parameters of a container, estimated by warping the annotated object onto its scan."""
    container, index = container_named(name), (*CONTAINER_NAMES, BIG_BOWL).index(name)
    seen = scan(container.mesh, np.random.default_rng([seed, 62, 1000, index]))  # for scans only
    warped = warp_object(annotated_source(), ObjectCloud(seen.points, seen.normals))
    ahead = container.opening_centre + np.array([0.2, 0.0, 0.0])
    found = pouring_parameters(warped, toward=ahead)
    lip = found.lip_point
    above_m = BALLS_ABOVE * half_full_radius_m(container)
    return Seen(found.references, lip, found.opening_centre, emptying(warped, lip, above_m))


@cache
def learn_pouring_skill(demonstrations: Path, seed: int) -> PouringSkill:
    """Learn the skill of pouring with other containers from a folder of bags.

    Raises:
        BagError: there are no pours in the folder.
    """
    shown = read_demonstrated(demonstrations)
    return learn_pouring(shown.pours, seen_as(shown.cup, seed), seen_as(shown.second, seed))

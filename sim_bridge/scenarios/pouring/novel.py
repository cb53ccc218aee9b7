# SPDX-License-Identifier: Apache-2.0
"""Pouring with containers nobody demonstrated: what the robot knows and which path it takes.

The primitive was learned with one pair of containers. Those of another pair are scanned, and their
warped parameters rescale a path of the primitive.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.bags import BagReader
from intent_recognition.objects import find_object, load_object
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.warping import (
    ObjectCloud,
    ObjectModel,
    References,
    WarpedPrimitive,
    from_warped,
    pouring_parameters,
    references,
    to_warped,
    warp_object,
)
from sim_bridge.containers import Container, scan
from sim_bridge.scenarios.pouring.recordings import pour_of
from sim_bridge.scenarios.pouring.task_space import PourPath
from sim_bridge.teaching import JOINT_TOPIC

ANNOTATED = "mug"
"""The shipped object whose parts are annotated."""
AHEAD_M = 0.2
"""How far from a container's opening the other one is, when its lip is chosen."""

PLAN_STEP_S = 0.05
"""Time between two points of a planned path [s]. Convention."""
N_BASIS = 30
"""Basis functions of the warped primitive. Convention."""


class Seen(NamedTuple):
    """Parameters of one container, estimated from a scan.

    Attributes:
        references: warped parameters that variables are divided by.
        lip_m: where it pours over (3,), in the container's frame.
        opening_m: centre of the opening (3,), in the container's frame.
    """

    references: References
    lip_m: NDArray[np.float64]
    opening_m: NDArray[np.float64]


class DemonstratedPours(NamedTuple):
    """The recorded demonstrations: pours (n), and the names of the two containers."""

    pours: Sequence[PourPath]
    cup: str
    second: str


def annotated_source() -> ObjectModel:
    """The one object whose parts are annotated, ready to be warped onto others."""
    return ObjectModel.learn(load_object(find_object(ANNOTATED)))


def look_at(source: ObjectModel, container: Container, rng: np.random.Generator) -> Seen:
    """Scan a container from three sides and warp the annotated object onto it."""
    seen = scan(container.mesh, rng)
    warped = warp_object(source, ObjectCloud(seen.points, seen.normals))
    ahead = container.opening_centre + np.array([AHEAD_M, 0.0, 0.0])
    found = pouring_parameters(warped, toward=ahead)
    return Seen(references(found), found.lip_point, found.opening_centre)


def read_pour(folder: Path) -> tuple[PourPath, dict[str, str]]:
    """The pour that a bag's joints made, and the bag's labels."""
    reader = BagReader(folder)
    stamps_ns, postures = [], []
    for recorded in reader.messages([JOINT_TOPIC]):
        joint_state: Any = recorded.message
        stamps_ns.append(recorded.stamp_ns)
        postures.append(joint_state.position)
    stamps = np.array(stamps_ns)
    labels = reader.custom_data
    times = (stamps - stamps[0]) * 1e-9
    return pour_of(times, np.array(postures), labels), labels


def read_demonstrated(folder: Path) -> DemonstratedPours:
    """All demonstrations below a folder, which are of one pair of containers."""
    found = [read_pour(path.parent) for path in sorted(folder.glob("*/metadata.yaml"))]
    labels = found[0][1]
    return DemonstratedPours([pour for pour, _ in found], labels["cup"], labels["second"])


def learn_pouring(pours: Sequence[PourPath], cup: Seen, second: Seen) -> WarpedPrimitive:
    """The primitive in the warped space from pours with one pair."""
    paths = [
        to_warped(pour.offset_m, pour.tilt_rad, cup.references, second.references) for pour in pours
    ]
    durations = [float(pour.times_s[-1]) for pour in pours]
    return WarpedPrimitive.learn(paths, durations, NormalizedRBFBasis(N_BASIS))


def plan(
    primitive: WarpedPrimitive,
    cup: References,
    second: References,
    rng: np.random.Generator | None = None,
) -> PourPath:
    """A path of the lip for containers with these references.

    Args:
        primitive: learned with any pair.
        cup: the container in the hand.
        second: the other one.
        rng: draws a path; the mean where left out.
    """
    count = round(primitive.duration_s / PLAN_STEP_S) + 1
    phase = np.linspace(0.0, 1.0, count)
    path = primitive.mean_path(phase) if rng is None else primitive.sample(phase, rng)
    return PourPath(phase * primitive.duration_s, *from_warped(path, cup, second))

# SPDX-License-Identifier: Apache-2.0
"""The mug's grasp carried to other containers, warped and not, and tested by lifting them."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from experiments.grasps.lifting import Lifted, LiftingWorld
from intent_recognition.errors import ArgumentError
from intent_recognition.objects import find_object, load_object
from intent_recognition.signals import homogeneous
from intent_recognition.warping import (
    Grasp,
    ObjectCloud,
    ObjectModel,
    WarpedObject,
    warp_grasp,
    warp_object,
)
from sim_bridge.containers import CONTAINER_NAMES, make_container, scan

SOURCE = "mug"
MADE, SCANNED = "made", "scanned"
WARPED, CARRIED = MANNERS = "warped", "not warped"
VIEWS = (1, 2, 3)
"""Numbers of camera views: one for each draw of the made containers, all for the scanned ones."""


def moved_rigidly(source: ObjectModel, warped: WarpedObject) -> Grasp:
    """The annotated grasp moved rigidly with the object's frame, without a warp."""
    grasp, own, frame = source.annotated.grasp, source.frame, warped.frame
    assert grasp is not None  # the mug's
    place = frame.origin + own.axes @ (grasp.centre - own.origin) @ frame.axes
    turn = frame.axes.T @ own.axes @ grasp.pose[:3, :3]
    return Grasp(homogeneous(turn, place), grasp.width_m)


CARRIERS = {WARPED: warp_grasp, CARRIED: moved_rigidly}


@dataclass(frozen=True, eq=False)
class Subject:
    """A container: its name, made or scanned, and its mesh in metres, z up."""

    name: str
    kind: str
    mesh: trimesh.Trimesh


@dataclass(frozen=True, eq=False)
class Trial:
    """One lift.

    Attributes:
        subject: the container.
        seed: of its size and of the camera.
        views: number of camera views.
        manner: one of `MANNERS`.
        grasp: in the container's coordinates; None where none was found.
        lifted: what became of it; None without a grasp.
    """

    subject: Subject
    seed: int
    views: int
    manner: str
    grasp: Grasp | None
    lifted: Lifted | None

    @property
    def held(self) -> bool:
        """Whether it was lifted and held."""
        return self.lifted is not None and self.lifted.held


def made(seed: int) -> Iterator[Subject]:
    """The containers of a seed but the annotated one's kind."""
    for name in CONTAINER_NAMES:
        if name != SOURCE:
            yield Subject(name, MADE, make_container(name, seed).mesh)


def scanned(folder: Path) -> Iterator[Subject]:
    """Scanned containers of a folder of meshes; none if it is not there."""
    for path in sorted(folder.glob("*.obj")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # materials that a file lacks
            mesh = trimesh.load_mesh(path)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        yield Subject(path.stem, SCANNED, mesh)


def seen(subject: Subject, views: int, seed: int) -> ObjectCloud:
    """The container as a depth camera sees it."""
    found = scan(subject.mesh, np.random.default_rng([seed, views]), views)
    return ObjectCloud(found.points, found.normals)


def grasp_on(source: ObjectModel, cloud: ObjectCloud, manner: str) -> Grasp | None:
    """The source's grasp on a container that was seen; None where none is found."""
    try:
        return CARRIERS[manner](source, warp_object(source, cloud))
    except ArgumentError:
        return None


def investigate(
    looks: Sequence[tuple[Subject, int, Sequence[int]]],
    progress: Callable[[float, str], None] = lambda share, what: None,
) -> tuple[list[Trial], list[str]]:
    """Lift each container by each grasp.

    Args:
        looks: containers, the seed of the camera, and from how many sides each is seen.
        progress: called with the share done and what is going on.

    Returns:
        The trials, those of `MANNERS` one after the other, and the names of what is no open
        container.
    """
    source = ObjectModel.learn(load_object(find_object(SOURCE)))
    trials, refused = [], []
    for number, (subject, seed, views) in enumerate(looks):
        progress(number / len(looks), subject.name.replace("_", " "))
        try:
            world = LiftingWorld(subject.mesh)
        except ArgumentError:
            refused.append(subject.name)
            continue
        with world:
            for n in views:
                cloud = seen(subject, n, seed)
                for manner in MANNERS:
                    grasp = grasp_on(source, cloud, manner)
                    lifted = None if grasp is None else world.lift(grasp)
                    trials.append(Trial(subject, seed, n, manner, grasp, lifted))
    return trials, refused


def share_held(trials: Sequence[Trial], manner: str, kind: str) -> float:
    """Share of the lifts in one manner, of one kind of container, that held."""
    chosen = [t.held for t in trials if t.manner == manner and t.subject.kind == kind]
    return float(np.mean(chosen))


def tipped_deg(trials: Sequence[Trial]) -> dict[str, float]:
    """By manner how far containers turned in the hand, median [deg], where both manners held."""
    pairs = [
        [lift.lifted.tipped_rad for lift in pair if lift.lifted and lift.held]
        for pair in zip(trials[::2], trials[1::2], strict=True)
    ]
    both = np.array([pair for pair in pairs if len(pair) == len(MANNERS)]).reshape(-1, len(MANNERS))
    median = np.degrees(np.median(both, axis=0)) if len(both) else np.full(len(MANNERS), np.nan)
    return dict(zip(MANNERS, median.tolist(), strict=True))

# SPDX-License-Identifier: Apache-2.0
"""The shipped annotated mug: `python -m experiments.annotate`."""

import sys

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.objects import FOLDER, save_object
from intent_recognition.share import share_path
from intent_recognition.signals import homogeneous
from intent_recognition.warping import AnnotatedObject, Grasp, Part
from sim_bridge.containers import Camera, Container, Sections, make_container, scan

N_AROUND, ALL_AROUND = 8, Camera(elevation_rad=(-0.9, 1.2))
"""Views from all sides."""
N_INTO, STRAIGHT_INTO = 4, Camera(elevation_rad=(1.3, 1.55))
"""Views straight into the container."""
SHARE_INTO = 0.25
"""Share of the points that views into the container give: from the side a camera hardly sees its
floor, and target points there would have no counterpart."""

GRASP_TURN = 0.25
"""Place of the grasp on the wall, in turns from the lip: neither at the lip nor at the handle."""
GRASP_DEPTH_M = 0.014
"""Distance from the crest down to the middle of the pads [m]: the pads are below the rim."""


def annotated(name: str = "mug", seed: int = 0, n_points: int = 2000) -> AnnotatedObject:
    """A container scanned from all around and straight into it, with labels and a grasp."""
    container = make_container(name, seed)
    rng = np.random.default_rng(seed)
    n_into = round(SHARE_INTO * n_points)
    seen = (
        scan(container.mesh, rng, N_AROUND, n_points - n_into, ALL_AROUND),
        scan(container.mesh, rng, N_INTO, n_into, STRAIGHT_INTO),
    )
    points, normals = (
        np.concatenate([getattr(one, part) for one in seen]) for part in ("points", "normals")
    )
    return AnnotatedObject(
        points, normals, labels_of(container, points), name, wall_grasp(container)
    )


def labels_of(container: Container, points: Floats) -> Integers:
    """Part (n,), values of `Part`, of surface points (n, 3) in the object's frame."""
    parts = np.full(len(points), int(Part.CONTAINER))
    if container.handle is not None:
        outside = _outer_distance(container.sections, points)
        parts[(outside > 0.0008) & (points[:, 0] < 0.0)] = int(Part.HANDLE)
    parts[(points[:, 2] > container.height_m - 0.0025) & (parts != Part.HANDLE)] = int(Part.RIM)
    return parts


def _outer_distance(sections: Sections, points: Floats) -> Floats:
    """Horizontal distance (n,) by which points are outside of the wall."""
    heights = np.concatenate([[0.0], sections.heights_m])
    radii = np.linalg.norm(np.concatenate([sections.base[None], sections.outer]), axis=2)
    n_corners = radii.shape[1]
    angle = np.arctan2(points[:, 1], points[:, 0]) % (2.0 * np.pi)
    corner = np.rint(angle / (2.0 * np.pi) * n_corners).astype(int) % n_corners
    row = np.interp(points[:, 2], heights, np.arange(len(heights)))
    low = np.minimum(row.astype(int), len(heights) - 2)
    share = row - low
    wall = (1.0 - share) * radii[low, corner] + share * radii[low + 1, corner]
    return np.linalg.norm(points[:, :2], axis=1) - wall


def wall_grasp(container: Container) -> Grasp:
    """A pinch of the wall from above, along the wall, one finger inside."""
    sections = container.sections
    corner = round(GRASP_TURN * sections.inner.shape[1])
    walls = (sections.outer[:, corner], sections.inner[:, corner])
    level = sections.heights_m[-1] - GRASP_DEPTH_M
    above, below = (
        np.array([np.interp(level + step, sections.heights_m, wall[:, 1]) for wall in walls])
        for step in (0.003, -0.003)
    )
    outward = np.array([0.0, 1.0, 0.0])
    down = np.array([0.0, below.mean() - above.mean(), -0.006])
    down /= np.linalg.norm(down)
    closing = outward - (outward @ down) * down
    closing /= np.linalg.norm(closing)
    middle = 0.5 * (above + below)
    axes = np.column_stack([np.cross(closing, down), closing, down])
    pose = homogeneous(axes, [0.0, middle.mean(), level])
    return Grasp(pose, float((middle[0] - middle[1]) * closing[1]))


if __name__ == "__main__":
    path = save_object(share_path("config") / FOLDER.split("/")[1] / "mug.npz", annotated())
    sys.stdout.write(f"{path}\n")

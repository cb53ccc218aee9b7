# SPDX-License-Identifier: Apache-2.0
"""The shipped annotated mug: `python -m experiments.annotate`."""

import sys

import numpy as np

from intent_recognition.objects import FOLDER, save_object
from intent_recognition.share import share_path
from intent_recognition.signals import homogeneous
from intent_recognition.warping import AnnotatedObject, Grasp
from sim_bridge.containers import Camera, Container, make_container, scan

N_AROUND, ALL_AROUND = 8, Camera(elevation_rad=(-0.9, 1.2))
"""Views from all sides."""
N_INTO, STRAIGHT_INTO = 4, Camera(elevation_rad=(1.3, 1.55))
"""Views straight into the container."""
SHARE_INTO = 0.25
"""From the side a camera hardly sees the floor, and where the source has no points no target
point has a counterpart."""

GRASP_TURN = 0.25
"""Where on the wall the grasp is, in turns from the lip: beside the lip and beside the handle."""
GRASP_DEPTH_M = 0.014
"""How far below the crest the middle of the pads is [m]: the pads are below the rim."""


def annotated(name: str = "mug", seed: int = 0, n_points: int = 2000) -> AnnotatedObject:
    """A container as its annotator sees it: from all around and straight into it, with labels."""
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
    return AnnotatedObject(points, normals, container.labels(points), name, wall_grasp(container))


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

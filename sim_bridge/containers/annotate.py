# SPDX-License-Identifier: Apache-2.0
"""The shipped annotated mug: `python -m sim_bridge.containers.annotate`."""

import sys

import numpy as np

from intent_recognition.objects import FOLDER, save_object
from intent_recognition.share import share_path
from intent_recognition.warping import AnnotatedObject
from sim_bridge.containers.generate import make_container
from sim_bridge.containers.scanning import Camera, scan

N_AROUND, ALL_AROUND = 8, Camera(elevation_rad=(-0.9, 1.2))
"""Views from all sides."""
N_INTO, STRAIGHT_INTO = 4, Camera(elevation_rad=(1.3, 1.55))
"""Views straight into the container."""
SHARE_INTO = 0.25
"""From the side a camera hardly sees the floor, and where the source has no points no target
point has a counterpart."""


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
    return AnnotatedObject(points, normals, container.labels(points), name)


if __name__ == "__main__":
    path = save_object(share_path("config") / FOLDER.split("/")[1] / "mug.npz", annotated())
    sys.stdout.write(f"{path}\n")

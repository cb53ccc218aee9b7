# SPDX-License-Identifier: Apache-2.0
"""The shipped annotated mug: `python -m sim_bridge.containers.annotate`."""

import sys

import numpy as np

from intent_recognition.share import share_path
from intent_recognition.storage.objects import FOLDER, save_object
from intent_recognition.warping.object_model import AnnotatedObject
from sim_bridge.containers.generate import make_container
from sim_bridge.containers.scan import Camera, scan

N_VIEWS = 8
ALL_AROUND = Camera(elevation_rad=(-0.9, 1.2))


def annotated(name: str = "mug", seed: int = 0, n_points: int = 2000) -> AnnotatedObject:
    """A container as its annotator sees it: scanned from all around, every point labelled."""
    container = make_container(name, seed)
    rng = np.random.default_rng(seed)
    seen = scan(container.mesh, rng, N_VIEWS, n_points, ALL_AROUND)
    return AnnotatedObject(seen.points, seen.normals, container.labels(seen.points), name)


if __name__ == "__main__":
    path = save_object(share_path("config") / FOLDER.split("/")[1] / "mug.npz", annotated())
    sys.stdout.write(f"{path}\n")

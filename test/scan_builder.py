# SPDX-License-Identifier: Apache-2.0
"""Scans of containers for tests, made once."""

import functools

import numpy as np

from intent_recognition.warping.object_model import ObjectCloud
from sim_bridge.containers import make_container, scan


@functools.cache
def scanned(name: str, seed: int = 1, n_views: int = 2) -> ObjectCloud:
    """A scan of a container, always the same."""
    seen = scan(make_container(name, seed).mesh, np.random.default_rng(seed), n_views)
    return ObjectCloud(seen.points, seen.normals)

# SPDX-License-Identifier: Apache-2.0
"""First guess of the rim by how the surface looks nearby, learned from the annotated object."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from intent_recognition.array_types import Floats
from intent_recognition.errors import TrainingError
from intent_recognition.warping.logistic import LogisticModel, fit_logistic
from intent_recognition.warping.object_model import AnnotatedObject, Part

N_POINTS = 2000
"""Points of the whole object and of each view, as many as a scan has."""


def fit_rim_classifier(source: AnnotatedObject, up: Floats) -> LogisticModel:
    """Learn to tell the rim from how the surface looks nearby (Brandl et al. II-B).

    A camera above sees more of the rim than of the walls. The annotated points are therefore
    thinned as one to three cameras would, and the classifier sees these clouds besides the whole.
    """
    n_rim = int((source.labels == Part.RIM).sum())
    if not 0 < n_rim < len(source.labels):
        cure = "Annotate the rim around the opening as RIM and the wall as CONTAINER."
        raise TrainingError.about("labels", "some points on the RIM", n_rim, cure)
    rng = np.random.default_rng(0)
    everything = np.arange(len(source.points))
    count = min(N_POINTS, len(everything))
    chosen = [everything, *(rng.choice(everything, count, replace=False) for _ in range(2))]
    chosen += [_seen(source, up, n_views, rng) for n_views in (1, 1, 1, 2, 2, 3, 3, 3)]
    features = np.concatenate([local_features(source.points[c], source.normals[c]) for c in chosen])
    on_rim = source.labels[np.concatenate(chosen)] == Part.RIM
    return fit_logistic(features, on_rim, ridge=1.0)  # classes overlap little


def local_features(
    points: Floats, normals: Floats, tree: cKDTree | None = None, rows: Floats | slice = slice(None)
) -> Floats:
    """Features of the neighbourhood of each point (Brandl et al. II-B).

    The eigenvalues of the neighbourhood's covariance and the distance to its mean, as in the
    paper, both in units of the neighbourhood's own size; neighbours on the other side of a thin
    wall count less. The spread of the normals tells a rim from the edge of a scan.

    Args:
        points: (n, 3) in metres.
        normals: outward unit normals (n, 3).
        tree: of the points, if there is one.
        rows: of the points whose features are wanted.

    Returns:
        Features (m, 16): eight and their squares.
    """
    tree = tree or cKDTree(points)
    count = min(20, len(points))
    _, near = tree.query(points[rows], k=count)
    offsets = points[near] - points[rows][:, None]
    around, own = normals[near], normals[rows]
    agreement = (around @ own[:, :, None])[:, :, 0]
    weights = np.maximum(agreement, 0.0) + 0.05
    weights /= weights.sum(1, keepdims=True)
    size = np.sqrt((offsets * offsets).sum((1, 2)) / count)
    offsets /= np.maximum(size, np.finfo(float).tiny)[:, None, None]  # 0: all in one place
    mean = (weights[:, None] @ offsets)[:, 0]
    covariance = (offsets * weights[:, :, None]).transpose(0, 2, 1) @ offsets
    covariance -= mean[:, :, None] * mean[:, None]
    spread = around.transpose(0, 2, 1) @ around / count
    facing = around.mean(1)
    features = np.column_stack(
        [
            np.linalg.eigvalsh(covariance),
            np.sqrt((mean * mean).sum(1)),
            (mean * own).sum(1),
            np.linalg.eigvalsh(spread)[:, :2],
            np.sqrt((facing * facing).sum(1)),
        ]
    )
    return np.column_stack([features, features * features])


def _seen(
    source: AnnotatedObject, up: Floats, n_views: int, rng: np.random.Generator
) -> NDArray[np.integer]:
    """Indices of points that cameras above would see, hidden ones behind others included."""
    first = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    first /= np.linalg.norm(first)
    second = np.cross(up, first)
    weight = np.zeros(len(source.points))
    start = rng.uniform(0.0, 2.0 * np.pi)
    for view in range(n_views):
        azimuth, elevation = start + 2.0 * np.pi * view / n_views, rng.uniform(0.7, 1.2)
        level = np.cos(azimuth) * first + np.sin(azimuth) * second
        facing = source.normals @ (np.cos(elevation) * level + np.sin(elevation) * up)
        weight += np.where(facing > 0.17, facing, 0.0)  # a camera sees nothing beyond 80 degrees
    count = min(N_POINTS, int((weight > 0.0).sum()) * 2 // 3)
    if not count:
        cure = "Let normals point outward, also inside the opening."
        raise TrainingError.about("normals", "some that a camera above faces", "none", cure)
    return rng.choice(len(weight), count, replace=False, p=weight / weight.sum())

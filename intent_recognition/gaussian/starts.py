# SPDX-License-Identifier: Apache-2.0
"""Starts of a mixture: k-means from k-means++ centres, many times over."""

import numpy as np

from intent_recognition.array_types import Floats, Integers


def kmeans_starts(
    points: Floats, n_components: int, n_starts: int, rng: np.random.Generator
) -> Integers:
    """Labels of n points (n, r) from `n_starts` independent runs, (n_starts, n).

    Centres are drawn by k-means++ (Arthur and Vassilvitskii 2007): each next one with probability
    proportional to the squared distance from those drawn. A cluster that loses all its points is
    given the point farthest from its centre, as long as there are enough different points.
    """
    n = len(points)
    squares = np.sum(points**2, axis=1)
    distance = np.maximum(squares[:, None] + squares - 2.0 * points @ points.T, 0.0)
    labels = np.empty((n_starts, n), dtype=np.int64)
    for start in range(n_starts):
        centers = _plus_plus(distance, n_components, rng)
        labels[start] = np.argmin(distance[centers], axis=0)
        for _ in range(10):  # EM refines what comes of it
            moved = _lloyd(distance, labels[start], n_components)
            if np.array_equal(moved, labels[start]):
                break
            labels[start] = moved
    return labels


def _plus_plus(distance: Floats, n_components: int, rng: np.random.Generator) -> list[int]:
    """Indices of the points drawn as centres, from squared distances (n, n)."""
    centers = [int(rng.integers(len(distance)))]
    nearest = distance[centers[0]].copy()
    for _ in range(n_components - 1):
        total = nearest.sum()
        if total > 0:
            centers.append(int(rng.choice(len(distance), p=nearest / total)))
        else:  # fewer different points than components
            centers.append(int(rng.integers(len(distance))))
        nearest = np.minimum(nearest, distance[centers[-1]])
    return centers


def _lloyd(distance: Floats, labels: Integers, n_components: int) -> Integers:
    """One step of k-means by distances alone: |x - mean|^2 from those between the points."""
    share = (labels == np.arange(n_components)[:, None]).astype(float)
    count = share.sum(axis=1)
    share /= np.maximum(count, 1.0)[:, None]
    mixed = share @ distance
    inner = 0.5 * np.sum(mixed * share, axis=1)
    to_center = np.where((count > 0)[:, None], mixed - inner[:, None], np.inf)
    moved = np.argmin(to_center, axis=0)
    own = to_center[moved, np.arange(len(moved))]
    for empty in np.setdiff1d(np.arange(n_components), moved):
        farthest = int(np.argmax(own))
        if own[farthest] <= 0 or np.sum(moved == moved[farthest]) == 1:
            break
        moved[farthest], own[farthest] = empty, 0.0
    return moved

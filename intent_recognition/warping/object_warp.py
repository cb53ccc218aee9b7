# SPDX-License-Identifier: Apache-2.0
"""Warping the annotated object onto another one (Brandl et al. II-B and II-C)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from intent_recognition.array_types import Flags, Floats, brief
from intent_recognition.errors import ArgumentError, TrainingError
from intent_recognition.warping.cavity import Cavity, fit_cavity
from intent_recognition.warping.frame import N_LEVELS, ObjectFrame, coarse_frame
from intent_recognition.warping.mapping import agreeing_neighbours, majority
from intent_recognition.warping.object_model import AnnotatedObject, ObjectCloud, Part
from intent_recognition.warping.opening import find_opening
from intent_recognition.warping.part_labels import LogisticModel, fit_rim_classifier, local_features
from intent_recognition.warping.rim import Rim, fit_rim

Mapping = Literal["label", "point"]
LEAST_M = 1e-6
"""Smallest extent of an object, and smallest distance between the means of its wall and rim [m];
real objects are far above it."""


@brief
@dataclass(frozen=True, eq=False)
class ObjectModel:
    """An annotated object with the classifier learned from it (Brandl et al. 2014, II-A).

    Attributes:
        annotated: the object.
        classifier: recognises the rim from the local shape of the surface.
        frame: frame of the object, found in the same way as that of a target.
    """

    annotated: AnnotatedObject
    classifier: LogisticModel
    frame: ObjectFrame

    @classmethod
    def learn(cls, annotated: AnnotatedObject) -> ObjectModel:
        """Learn classifier and frame of the annotated object.

        Raises:
            TrainingError: no rim or no container is annotated, or both have the same mean.
            ArgumentError: the object has no opening.
        """
        parts = (Part.CONTAINER, Part.RIM)
        if missing := [part.name for part in parts if not (annotated.labels == part).any()]:
            cure = "Annotate the rim around the opening as RIM and the wall as CONTAINER."
            got = f"no {' and no '.join(missing)}"
            raise TrainingError.about("labels", "points of CONTAINER and RIM", got, cure)
        container, rim = (annotated.points[annotated.labels == part].mean(0) for part in parts)
        apart_m = float(np.linalg.norm(rim - container))
        if apart_m < LEAST_M:
            cure = "Annotate the rim around the opening as RIM, in metres."
            expected = f"at least {LEAST_M:g} m from the wall's middle to the rim's"
            raise TrainingError.about("points", expected, f"{apart_m:g} m", cure)
        up = (rim - container) / apart_m
        classifier = fit_rim_classifier(annotated, up)
        return cls(annotated, classifier, _frame(annotated, classifier))


@brief
@dataclass(frozen=True, eq=False)
class WarpedObject:
    """Result of warping source and target: points with part labels.

    Attributes:
        points: (n, 3) [m], in the target's coordinates.
        normals: outward unit normals (n, 3).
        labels: part (n,) of each point.
        frame: frame of the target, with axes toward the opening and toward the handle.
        mapping: "label" if the points are the target's, "point" if they are the source's, moved.
    """

    points: Floats
    normals: Floats
    labels: NDArray[np.integer]
    frame: ObjectFrame
    mapping: Mapping

    def part(self, part: Part) -> Floats:
        """Points (m, 3) of one part."""
        return self.points[self.labels == part]

    @cached_property
    def rim(self) -> Rim:
        """The rim as a closed line in the plane of the opening."""
        on_rim = self.labels == Part.RIM
        return fit_rim(self.points[on_rim], self.normals[on_rim], self.frame)

    @cached_property
    def cavity(self) -> Cavity:
        """The inner surface below the rim.

        Where many source points were moved to one place, because their part of the wall was not
        seen, that place counts once.
        """
        kept = np.flatnonzero(self.labels != Part.HANDLE)
        if self.mapping == "point":
            _, first = np.unique(self.points[kept], axis=0, return_index=True)
            kept = kept[np.sort(first)]
        return fit_cavity(self.points[kept], self.normals[kept], self.rim)


def warp_object(
    source: ObjectModel, target: ObjectCloud, mapping: Mapping = "label", k: int = 1
) -> WarpedObject:
    """Warp the annotated object onto another one (Brandl et al. 2014, II-B and II-C).

    Args:
        source: the annotated object, from `ObjectModel.learn`.
        target: an object of any position, orientation and size.
        mapping: "label" gives each target point the part of its nearest source points; "point"
            moves each source point to its nearest target points.
        k: number of neighbours that vote on a label, or are averaged.

    Raises:
        ArgumentError: the target is not one container with an opening, the mapping is unknown, or k
            is not between one and the number of points.
    """
    if mapping not in ("label", "point"):
        cure = "See docs/warping.md."
        raise ArgumentError.about("mapping", "'label' or 'point'", repr(mapping), cure)
    check_scan(target.points)
    frame = _frame(target, source.classifier)
    aside = float(np.linalg.norm(frame.to_local(target.points)[:, 1:].mean(0)))
    if aside > 0.7 * frame.radius_m:
        cure = "Cut the cloud into objects and warp one at a time."
        got = f"points that lie {aside / frame.radius_m:.1f} radii beside the opening"
        raise ArgumentError.about("points", "one container", got, cure)
    points, normals, kept = aligned_source(source, frame)
    points, normals, labels = points[kept], normals[kept], source.annotated.labels[kept]
    seen, seen_normals = frame.to_local(target.points), target.normals @ frame.axes.T
    if mapping == "label":
        near = agreeing_neighbours(seen, seen_normals, points, normals, k)
        warped = (target.points, target.normals, majority(labels[near], len(Part)))
    else:
        # Points of an unseen part of the wall would be moved to the inside of the handle.
        body = np.flatnonzero(~frame.on_handle(seen))
        near = np.empty((len(points), k), dtype=int)
        for rows, to in ((labels != Part.HANDLE, body), (labels == Part.HANDLE, slice(None))):
            found = agreeing_neighbours(points[rows], normals[rows], seen[to], seen_normals[to], k)
            near[rows] = np.arange(len(seen))[to][found]
        mean_normals = target.normals[near].mean(1)
        mean_normals /= np.maximum(np.linalg.norm(mean_normals, axis=1, keepdims=True), 1e-12)
        warped = (target.points[near].mean(1), mean_normals, labels)
    return WarpedObject(*warped, frame, mapping)


def _frame(cloud: ObjectCloud, classifier: LogisticModel) -> ObjectFrame:
    """The coarse frame of an unlabelled object."""
    tree = cKDTree(cloud.points)
    # The first guess is made from some 600 points.
    for step in sorted({max(1, len(cloud.points) // 600), 1}, reverse=True):
        rows = slice(None, None, step)
        features = local_features(cloud.points, cloud.normals, tree, rows)
        on_rim = classifier.probability(features)
        opening = find_opening(cloud.points[rows], cloud.normals[rows], on_rim)
        if opening is not None:
            return coarse_frame(cloud.points, cloud.normals, opening)
    cure = "It may be closed on top, a third wider below than at its rim, or no cup or bowl."
    got = "no rim around a cavity"
    raise ArgumentError.about("points", "a container with an open rim", got, cure)


def aligned_source(source: ObjectModel, target: ObjectFrame) -> tuple[Floats, Floats, Flags]:
    """Points (n, 3) and normals (n, 3) of the source, scaled to the target's size in its axes.

    Height and radius are scaled separately, the radius level by level by the widths of the walls. A
    handle is stretched to the target's reach.

    Returns:
        Points, normals, and which points (n,) the target has: all but a handle that it lacks.
    """
    own = source.frame
    points = own.to_local(source.annotated.points)
    normals = source.annotated.normals @ own.axes.T
    tall = target.height_m / own.height_m
    levels = ((np.arange(N_LEVELS) + 0.5) / N_LEVELS - 1.0) * own.height_m
    widths = target.wall * target.radius_m / (own.wall * own.radius_m)
    # At the opening, the rim gives the width.
    levels, widths = np.append(levels, 0.0), np.append(widths, target.radius_m / own.radius_m)
    wide = np.interp(points[:, 0], levels, widths)
    slope = np.interp(points[:, 0], levels, np.gradient(widths, levels))
    # Normals turn by the inverse transpose of the mapping's derivative.
    outward = (points[:, 1:] * normals[:, 1:]).sum(1)
    normals = np.column_stack(
        [(normals[:, 0] - slope / wide * outward) / tall, normals[:, 1:] / wide[:, None]]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = np.column_stack([tall * points[:, 0], wide[:, None] * points[:, 1:]])
    handle = source.annotated.labels == Part.HANDLE
    if own.has_handle and target.has_handle:
        scale = target.radius_m / own.radius_m
        stretch = (target.reach_m - target.radius_m) / (scale * (own.reach_m - own.radius_m))
        radius = np.linalg.norm(points[handle, 1:], axis=1)
        longer = np.maximum(radius - target.radius_m, 0.0) * (stretch - 1.0)
        points[handle, 1:] *= (1.0 + longer / radius)[:, None]
        return points, normals, np.ones(len(points), dtype=bool)
    return points, normals, ~handle


def check_scan(points: Floats) -> None:
    """Refuse points (n, 3) that cannot be one cup or bowl in metres."""
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if not 0.01 < extent < 1.5:
        cure = "Give points in metres: millimetres are scaled by 0.001, centimetres by 0.01."
        expected = "a cup or bowl of 0.01 to 1.5 m"
        raise ArgumentError.about("points", expected, f"{extent:.3g} m across", cure)
    offsets = points - points.mean(0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(offsets.T @ offsets / len(points)), 0.0))
    if spread[0] < 0.03 * spread[2]:
        cure = "Cut out the object, not the table, and scan it from more sides."
        got = f"one of {1e3 * spread[0]:.2g} by {1e3 * spread[2]:.2g} mm (standard deviations)"
        raise ArgumentError.about("points", "a body with a depth", got, cure)
    # In one view, only a thin rim may join two walls; few points may miss it.
    for n_looked_at in (500, 4000):
        sizes = _pieces(points, n_looked_at)
        if len(sizes) == 1 or sizes[1] <= 0.25 * sizes[0]:
            break
    else:
        cure = "Cut the cloud into objects and warp one at a time."
        got = f"{np.count_nonzero(sizes > 0.08 * sizes[0])} pieces apart from one another"
        raise ArgumentError.about("points", "one object", got, cure)


def _pieces(points: Floats, n_looked_at: int) -> NDArray[np.integer]:
    """Sizes of connected pieces of a cloud thinned to about `n_looked_at` points, descending."""
    looked_at = points[:: max(1, len(points) // n_looked_at)]
    tree = cKDTree(looked_at)
    nearest = np.asarray(tree.query(looked_at, k=2)[0])
    reach_m = 5.0 * float(np.median(nearest[:, 1]))
    pairs = tree.query_pairs(reach_m, output_type="ndarray")
    n = len(looked_at)
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, piece = connected_components(links, directed=False)
    return np.sort(np.bincount(piece))[::-1]

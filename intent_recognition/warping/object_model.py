# SPDX-License-Identifier: Apache-2.0
"""Objects as points with outward normals and part labels (Brandl et al. II-A), and a grasp."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from intent_recognition.array_types import Floats, brief, settle
from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.untrusted import LARGEST

NEIGHBOURS = 10
"""Number of points to which a plane is fitted to estimate a normal."""


@dataclass(frozen=True, eq=False)
class Grasp:
    """Grasp of an object with two parallel fingers.

    Attributes:
        pose: pose of the fingers (4, 4) in the object's coordinates [m]. The origin is midway
            between the pads, the fingers close along y, and the hand approaches along z. The two
            fingers are alike, so a half turn about z is the same grasp.
        width_m: distance of the pads when they touch the object; the hand opens wider before.

    Raises:
        ShapeError: the pose is not (4, 4).
        ArgumentError: the pose is no rigid motion, or the width is not above 0.
    """

    pose: Floats
    width_m: float

    def __post_init__(self) -> None:
        """Check the values and make a read-only copy of the pose."""
        pose = np.array(self.pose, dtype=float)
        if pose.shape != (4, 4):
            raise ShapeError.about("pose", "shape (4, 4)", pose.shape, "Give a 4x4 matrix.")
        turn = pose[:3, :3]
        rigid = np.all(np.abs(pose) <= LARGEST) and np.array_equal(pose[3], [0.0, 0.0, 0.0, 1.0])
        if not rigid or np.abs(turn.T @ turn - np.eye(3)).max() > 1e-4:  # files keep 32 bits
            cure = "Give orthonormal axes as columns, and the last row 0, 0, 0, 1."
            raise ArgumentError.about("pose", "a rigid motion", pose.tolist(), cure)
        if np.linalg.det(turn) < 0.0:
            cure = "Let x be the cross product of y and z."
            raise ArgumentError.about("pose", "right-handed axes", "left-handed ones", cure)
        if not (np.isfinite(self.width_m) and self.width_m > 0.0):
            cure = "Give the distance of the two contacts in metres."
            raise ArgumentError.about("width_m", "a number above 0", self.width_m, cure)
        settle(self, pose=pose, width_m=float(self.width_m))

    @property
    def centre(self) -> Floats:
        """Middle between the pads (3,) [m]."""
        return self.pose[:3, 3]

    @property
    def closing(self) -> Floats:
        """Unit direction (3,) in which the fingers close."""
        return self.pose[:3, 1]

    @property
    def approach(self) -> Floats:
        """Unit direction (3,) in which the hand approaches."""
        return self.pose[:3, 2]


class Part(IntEnum):
    """Part of a container that a surface point belongs to (Brandl et al. II-A)."""

    CONTAINER = 0
    RIM = 1
    HANDLE = 2


@brief
@dataclass(frozen=True, eq=False)
class ObjectCloud:
    """The surface of an object.

    Attributes:
        points: (n, 3) [m], n at least 100.
        normals: outward normals, (n, 3), which are scaled to unit length.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: too few points, or a value is not finite.
    """

    points: Floats
    normals: Floats

    def __post_init__(self) -> None:
        """Check shapes, finiteness and normals; make read-only copies with unit normals."""
        points = checked_points(self.points)
        normals = np.array(self.normals, dtype=float)
        if normals.shape != points.shape:
            cure = "Give one outward normal per point, or use `with_estimated_normals`."
            raise ShapeError.about("normals", f"shape {points.shape}", normals.shape, cure)
        fits = np.all(np.abs(normals) <= 1e150, axis=1)  # its square is still a number
        length = np.linalg.norm(np.where(fits[:, None], normals, 0.0), axis=1)
        bad = length <= 1e-9
        if bad.any():
            cure = "Leave those points out, or use `with_estimated_normals`."
            raise ArgumentError.about(
                "normals", "finite ones, not 0", f"{bad.sum()} others of {len(bad)}", cure
            )
        normals /= length[:, None]
        settle(self, points=points, normals=normals)


@brief
@dataclass(frozen=True, eq=False)
class AnnotatedObject(ObjectCloud):
    """An object whose parts are known.

    Attributes:
        points: (n, 3) [m], n at least 100.
        normals: outward unit normals, (n, 3).
        labels: part (n,) of each point, values of `Part`.
        name: name of the object.
        grasp: how two fingers hold it; None if no grasp is annotated.

    Raises:
        ShapeError: the arrays do not fit each other.
        ArgumentError: as for `ObjectCloud`, or a label is not a value of `Part`.
    """

    labels: NDArray[np.integer] = field(default_factory=lambda: np.zeros(0, dtype=int))
    name: str = "object"
    grasp: Grasp | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        labels = np.array(self.labels)
        if labels.shape != (len(self.points),):
            cure = "Give one label per point."
            raise ShapeError.about("labels", f"({len(self.points)},)", labels.shape, cure)
        if not np.isin(labels, list(Part)).all():
            cure = "Use CONTAINER 0, RIM 1 and HANDLE 2."
            got = np.setdiff1d(labels, list(Part))[:3]
            raise ArgumentError.about("labels", "values of Part", got, cure)
        settle(self, labels=labels.astype(int))


def checked_points(points: Floats) -> Floats:
    """A float copy of points (n, 3)."""
    points = np.array(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise ShapeError.about("points", "shape (n, 3)", points.shape, "One row per point.")
    if len(points) < 100:
        cure = "Scan the object closer or from more sides."
        raise ArgumentError.about("points", "at least 100", len(points), cure)
    bad = ~np.all(np.abs(points) <= LARGEST, axis=1)
    if bad.any():
        cure = "Leave pixels without depth out."
        got = f"{np.sum(bad)} of {len(points)} with NaN or beyond {LARGEST:g} m"
        raise ArgumentError.about("points", "finite coordinates", got, cure)
    return points


def with_estimated_normals(points: Floats, viewpoints: Floats | None) -> ObjectCloud:
    """Make a cloud whose normals are those of planes fitted to each point's neighbours.

    A surface is only seen from outside, so each normal is turned toward the camera. Points on the
    other side of a thin wall are not seen by the same camera; neighbours are therefore searched
    among the points of the same camera, if it sees at least `NEIGHBOURS`.

    Args:
        points: (n, 3) [m].
        viewpoints: position of the camera (3,), or of each point's camera (n, 3) [m].

    Raises:
        ShapeError: viewpoints are neither (3,) nor (n, 3).
        ArgumentError: viewpoints are missing or not finite, or the points are bad.
    """
    points = checked_points(points)
    if viewpoints is None:
        cure = "Give normals or viewpoints: without either, inside and outside look alike."
        raise ArgumentError.about("viewpoints", "positions of the camera", "none", cure)
    eyes = np.asarray(viewpoints, dtype=float)
    if eyes.shape not in ((3,), points.shape):
        cure = "Give one place, or one per point."
        raise ShapeError.about("viewpoints", f"(3,) or {points.shape}", eyes.shape, cure)
    if not np.isfinite(eyes).all():
        raise ArgumentError.about("viewpoints", "finite places", eyes, "Leave NaN out.")
    normals = np.empty_like(points)
    groups = [np.arange(len(points))]
    if eyes.ndim == 2:
        _, group = np.unique(eyes, axis=0, return_inverse=True)
        groups = [np.flatnonzero(group.ravel() == one) for one in range(group.max() + 1)]
    for rows in groups:
        seen = points[rows] if len(rows) >= NEIGHBOURS else points
        normals[rows] = _plane_normals(points[rows], seen)
    away = ((eyes - points) * normals).sum(1) < 0.0
    normals[away] *= -1.0
    return ObjectCloud(points, normals)


def _plane_normals(points: Floats, cloud: Floats) -> Floats:
    """Unit normals (n, 3), of either sign, of planes through each point's neighbours in a cloud."""
    _, near = cKDTree(cloud).query(points, k=NEIGHBOURS)
    offsets = cloud[near] - cloud[near].mean(1, keepdims=True)
    _, vectors = np.linalg.eigh(offsets.transpose(0, 2, 1) @ offsets)
    return vectors[:, :, 0]

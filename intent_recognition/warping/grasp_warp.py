# SPDX-License-Identifier: Apache-2.0
"""An annotated grasp carried to another object by the warp.

The surface that the pads touch on the source is warped as any part of it is: brought to the
target's size in its frame, and from there to the nearest points whose normals agree. Both
neighbourhoods, before and after, give a frame and a distance of the contacts; the grasp moves with
the frame and widens with the distance.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.signals import homogeneous
from intent_recognition.warping.mapping import agreeing_neighbours
from intent_recognition.warping.object_model import AnnotatedObject, Grasp
from intent_recognition.warping.object_warp import ObjectModel, WarpedObject, aligned_source

MIN_FACING = 0.5
"""Least cosine between a pad's direction and the normal of what it touches. Convention: 60
degrees."""
MIN_POINTS = 4
"""Points of the annotated object that a pad must touch."""


class _Contacts(NamedTuple):
    """What both pads touch: axes as columns (3, 3), middle (3,) and distance of the two sides."""

    axes: Floats
    middle: Floats
    width_m: float


class _Side(NamedTuple):
    """The surface under one pad: rows (n,) of the source, and their points and normals (n, 3)
    on the target; how far (3,) they were moved there, or None where nothing was seen.
    """

    rows: NDArray[np.integer]
    points: Floats
    normals: Floats
    moved: Floats | None


def contact_rows(
    annotated: AnnotatedObject, grasp: Grasp
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """Rows of the points under the pad on the side of +y, and under the other."""
    local = (annotated.points - grasp.centre) @ grasp.pose[:3, :3]
    facing = annotated.normals @ grasp.closing
    near = (np.abs(local[:, [0, 2]]) < 0.012).all(1)  # half a pad of a usual gripper
    near &= np.abs(local[:, 1]) < 0.5 * grasp.width_m + 0.004  # the sagitta of a cup's wall
    sides = tuple(np.flatnonzero(near & (sign * facing > MIN_FACING)) for sign in (1.0, -1.0))
    least = min(len(rows) for rows in sides)
    if least < MIN_POINTS:
        cure = "Move its pose to the wall, y across it, or annotate more points there."
        expected = f"at least {MIN_POINTS} points of the object under each pad"
        raise ArgumentError.about("grasp", expected, least, cure)
    return sides[0], sides[1]


def warp_grasp(source: ObjectModel, warped: WarpedObject) -> Grasp:
    """Carry the annotated grasp to the object that the source was warped onto.

    A side of the wall that no camera saw is taken to be where the source's would be, moved along
    with the other side.

    Args:
        source: the annotated object, with a grasp.
        warped: of `warp_object`, by any mapping.

    Returns:
        The grasp in the target's coordinates.

    Raises:
        ArgumentError: the source has no grasp, it holds a handle and the target has none, or the
            fingers would have to come through the wall.
    """
    grasp = source.annotated.grasp
    if grasp is None:
        cure = "Annotate one; docs/warping.md says how."
        raise ArgumentError.about("grasp", "an annotated one", "none in the source", cure)
    frame, own = warped.frame, source.frame
    aligned, aligned_normals, kept = aligned_source(source, frame)
    seen, seen_normals = frame.to_local(warped.points), warped.normals @ frame.axes.T
    approach = own.axes @ grasp.approach
    sides = []
    for rows in contact_rows(source.annotated, grasp):
        rows = rows[kept[rows]]
        if len(rows) < MIN_POINTS:
            cure = "Annotate a grasp of the wall."
            raise ArgumentError.about("grasp", "a target with a handle", "one without", cure)
        near = agreeing_neighbours(aligned[rows], aligned_normals[rows], seen, seen_normals)[:, 0]
        start = (rows, aligned[rows], aligned_normals[rows])
        reach = 0.3 * frame.radius_m  # between the noise of a scan and the far wall of a cup
        sides.append(_moved(*start, seen[near], seen_normals[near], approach, reach))
    first, second = (
        side if side.moved is not None or other.moved is None
        else side._replace(points=side.points + other.moved)
        for side, other in (sides, sides[::-1])
    )  # fmt: skip
    annotated = source.annotated
    before = _contacts(
        [own.to_local(annotated.points[side.rows]) for side in (first, second)],
        [annotated.normals[side.rows] @ own.axes.T for side in (first, second)],
        approach,
    )
    after = _contacts([first.points, second.points], [first.normals, second.normals], approach)
    wide, tall = frame.radius_m / own.radius_m, frame.height_m / own.height_m
    turn = after.axes @ before.axes.T
    offset = [tall, wide, wide] * (own.to_local(grasp.centre) - before.middle)
    held = frame.axes.T @ turn @ own.axes @ grasp.pose[:3, :3]
    centre = frame.origin + (after.middle + turn @ offset) @ frame.axes
    width = max(after.width_m / before.width_m, 0.2 * wide) * grasp.width_m
    return Grasp(homogeneous(held, centre), width)


def _moved(
    rows: NDArray[np.integer],
    points: Floats,
    normals: Floats,
    near: Floats,
    facing: Floats,
    approach: Floats,
    reach: float,
) -> _Side:
    """Points (n, 3) under a pad moved across the approach to the surface at those near (n, 3).

    Each moves to the plane through its target point, square to the normal there: how the target
    happens to be sampled does not matter, and the depth along the approach stays.
    """
    offsets = near - points
    across = facing - np.outer(facing @ approach, approach)
    steep = (across**2).sum(1)
    close = np.linalg.norm(offsets, axis=1) < reach
    close &= ((facing * normals).sum(1) > 0.7) & (steep > MIN_FACING**2)
    if close.mean() < 0.5:
        return _Side(rows, points, normals, None)
    moves = ((offsets * facing).sum(1) / np.maximum(steep, MIN_FACING**2))[:, None] * across
    moves = moves[close]
    return _Side(rows[close], points[close] + moves, facing[close], moves.mean(0))


def _contacts(points: list[Floats], normals: list[Floats], approach: Floats) -> _Contacts:
    """Frame and width of two touched surfaces, the one toward +y first."""
    closing = normals[0].mean(0) - normals[1].mean(0)
    closing /= np.linalg.norm(closing)
    along = approach - (approach @ closing) * closing
    if np.linalg.norm(along) < MIN_FACING:
        cure = "Grasp this object by hand."
        got = "a wall across the approach"
        raise ArgumentError.about("grasp", "a wall along the approach", got, cure)
    along /= np.linalg.norm(along)
    ends = [some.mean(0) for some in points]
    axes = np.column_stack([np.cross(closing, along), closing, along])
    return _Contacts(axes, 0.5 * (ends[0] + ends[1]), float((ends[0] - ends[1]) @ closing))

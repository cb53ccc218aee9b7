# SPDX-License-Identifier: Apache-2.0
"""Transfer an annotated grasp to another object by the warp.

The surface that the pads touch on the source is warped like the rest: it is scaled to the target's
size in the target's frame, and moved to the nearest points whose normals agree. Before and after
the warp, the touched surfaces define a frame and a width. The grasp moves with the frame, and its
width scales with the width.
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
"""Smallest cosine between a pad's direction and the surface normal that it touches (60 degrees)."""
MIN_POINTS = 4
"""Fewest points of the annotated object that a pad must touch."""


class _Contacts(NamedTuple):
    """Frame of both contacts: axes as columns (3, 3), middle (3,), and distance of the sides."""

    axes: Floats
    middle: Floats
    width_m: float


class _Side(NamedTuple):
    """Surface under one pad: rows (n,) of the source, and their points and normals (n, 3) on the
    target; `moved` is their mean displacement (3,), or None if the target was not seen there.
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
    """Transfer the annotated grasp to the object that the source was warped onto.

    A side of the wall that no camera saw is assumed where the aligned source has it, displaced like
    the other side.

    Args:
        source: the annotated object, with a grasp.
        warped: result of `warp_object`, with any mapping.

    Returns:
        The grasp in the target's coordinates.

    Raises:
        ArgumentError: the source has no grasp, the grasp holds a handle and the target has none, or
            the fingers would have to come through the wall.
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
    """Move points (n, 3) under a pad, across the approach, to the surface at `near` (n, 3).

    Each point moves to the plane through its target point, perpendicular to the normal there. The
    sampling of the target therefore does not matter, and the depth along the approach is kept.
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

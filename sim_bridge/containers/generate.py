# SPDX-License-Identifier: Apache-2.0
"""Seeded generators of ten cups and bowls, built from profiles without boolean operations."""

from dataclasses import dataclass, replace

import numpy as np
import trimesh

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.warping import closed_tube_faces, surface_volume
from sim_bridge.containers.container import Container, Sections

CONTAINER_SEED = 1
"""Seed of the shapes of the ten containers in all recordings and trials."""


@dataclass(frozen=True)
class ContainerShape:
    """Shape of a kind of container; lengths in metres.

    Attributes:
        height_m: height from the base to the crest.
        base_m, top_m: outer radii at the base and at the crest.
        bulge: exponent of the profile; 1 is a cone, less bulges outward.
        squareness: exponent of the outline; 2 is a circle, more approaches a square.
        handle_m: distance by which the handle protrudes, 0 without a handle.
        grip_m: radius of the handle's tube.
    """

    height_m: float
    base_m: float
    top_m: float
    wall_m: float
    floor_m: float
    bulge: float = 1.0
    squareness: float = 2.0
    handle_m: float = 0.0
    grip_m: float = 0.0


SHAPES = {
    "mug": ContainerShape(0.095, 0.038, 0.0415, 0.0035, 0.006, 0.35, 2.0, 0.030, 0.0045),
    "tall_mug": ContainerShape(0.120, 0.036, 0.0400, 0.0040, 0.007, 0.80, 2.0, 0.033, 0.0050),
    "espresso_cup": ContainerShape(0.060, 0.022, 0.0310, 0.0030, 0.005, 0.60, 2.0, 0.020, 0.0035),
    "tea_cup": ContainerShape(0.064, 0.024, 0.0480, 0.0028, 0.005, 0.50, 2.0, 0.024, 0.0035),
    "tall_glass": ContainerShape(0.140, 0.029, 0.0345, 0.0024, 0.008),
    "tumbler": ContainerShape(0.090, 0.034, 0.0410, 0.0030, 0.009, 0.70),
    "paper_cup": ContainerShape(0.108, 0.029, 0.0430, 0.0020, 0.004),
    "round_bowl": ContainerShape(0.068, 0.032, 0.0700, 0.0040, 0.006, 0.50),
    "shallow_bowl": ContainerShape(0.046, 0.042, 0.0850, 0.0040, 0.006, 0.60),
    "square_bowl": ContainerShape(0.060, 0.050, 0.0640, 0.0040, 0.006, 0.60, 5.0),
}
"""The ten containers by name."""
CONTAINER_NAMES = tuple(SHAPES)


def make_container(name: str, seed: int = 0) -> Container:
    """Make one of the ten containers in its own frame; the seed determines its shape.

    Raises:
        ArgumentError: there is no such container.
    """
    if name not in SHAPES:
        cure = "Take one of these."
        raise ArgumentError.about("container", f"one of {', '.join(SHAPES)}", repr(name), cure)
    shape, rng = SHAPES[name], np.random.default_rng([seed, CONTAINER_NAMES.index(name)])
    tall, wide = rng.uniform(0.92, 1.08, 2)
    varied = replace(
        shape,
        height_m=shape.height_m * tall,
        base_m=shape.base_m * wide,
        top_m=shape.top_m * wide,
        handle_m=shape.handle_m * wide,
    )
    return build_container(name, varied)


def build_container(name: str, shape: ContainerShape) -> Container:
    """Build the solid, its cavity and its ground truth from a shape."""
    sections = _sections(shape)
    wall, inner = _wall(sections), close_rings(at_heights(sections.inner, sections.heights_m))
    handle = _handle(shape, sections) if shape.handle_m else None
    crest = sections.outer[-1]
    edges = np.linalg.norm(np.roll(crest, -1, axis=0) - crest, axis=1)
    weights = edges + np.roll(edges, 1)
    return Container(
        name=name,
        mesh=wall if handle is None else trimesh.util.concatenate([wall, handle]),
        inner=inner,
        sections=sections,
        handle=handle,
        opening_radius_m=float(np.average(np.linalg.norm(crest, axis=1), weights=weights)),
        height_m=shape.height_m,
        inner_volume_m3=surface_volume(inner.vertices, inner.faces),
        opening_centre=np.array([0.0, 0.0, shape.height_m]),
    )


def _profile(shape: ContainerShape, share: Floats) -> Floats:
    """Outer radius at shares of the height."""
    return shape.base_m + (shape.top_m - shape.base_m) * share**shape.bulge


def _sections(shape: ContainerShape) -> Sections:
    """Rings from the floor of the cavity to the crest, denser at the bottom and at the top."""
    shoulder = shape.height_m - 0.5 * shape.wall_m
    share = np.linspace(0.0, 1.0, 15) ** 1.5
    body = shape.floor_m + (shoulder - shape.floor_m) * share
    rise = np.array([0.4, 0.7, 0.9, 1.0])
    heights = np.concatenate([body, shoulder + 0.5 * shape.wall_m * rise])
    outer = _profile(shape, heights / shape.height_m)
    cavity = (heights - shape.floor_m) / (shape.height_m - shape.floor_m)
    inner = _profile(shape, cavity) - shape.wall_m
    # The rim is a half circle about the middle of the wall.
    middle, half = 0.5 * (outer + inner), 0.5 * (outer - inner)
    half[len(body) :] *= np.sqrt(1.0 - rise**2)
    angles = np.arange(N_CORNERS) * 2.0 * np.pi / N_CORNERS
    direction = np.stack([np.cos(angles), np.sin(angles)], 1)
    power = shape.squareness
    outline = direction * ((np.abs(direction) ** power).sum(1) ** (-1.0 / power))[:, None]
    return Sections(
        heights_m=heights,
        inner=(middle - half)[:, None, None] * outline,
        outer=(middle + half)[:, None, None] * outline,
        base=_profile(shape, np.zeros(1))[0] * outline,
    )


def _wall(sections: Sections) -> trimesh.Trimesh:
    """Surface of the solid without its handle: up the outside, over the crest, down the inside."""
    base = at_heights(sections.base[None], np.zeros(1))
    inner, outer = (at_heights(o, sections.heights_m) for o in (sections.inner, sections.outer))
    return close_rings(np.concatenate([base, outer, inner[-2::-1]]))


def _handle(shape: ContainerShape, sections: Sections) -> trimesh.Trimesh:
    """An ear toward -x whose ends lie in the middle of the wall."""
    heights = sections.heights_m
    middle = np.linalg.norm(0.5 * (sections.inner + sections.outer)[:, 0], axis=1)
    upper, lower = 0.84 * shape.height_m, 0.24 * shape.height_m
    angles = np.linspace(0.0, np.pi, 25)
    wide = np.sin(angles) ** 0.7
    z = 0.5 * (upper + lower) + 0.5 * (upper - lower) * np.cos(angles)
    x = -np.interp(z, heights, middle) - shape.handle_m * wide
    path = np.stack([x, np.zeros_like(x), z], 1)
    tube = swept_tube(path, shape.grip_m, end_tangent=np.array([-1.0, 0.0, 0.0]))
    for ring in (tube[0], tube[-1]):
        radius = np.interp(ring[:, 2], heights, middle)
        ring[:, 0] = -np.sqrt(radius**2 - ring[:, 1] ** 2)
    return close_rings(tube)


N_CORNERS, TUBE_CORNERS = 64, 16
"""Number of corners of each outline, and of a handle's cross section."""


def at_heights(outlines: Floats, heights_m: Floats) -> Floats:
    """Rings (R, S, 3) of outlines (R, S, 2) at heights (R,)."""
    z = np.broadcast_to(heights_m[:, None, None], (*outlines.shape[:2], 1))
    return np.concatenate([outlines, z], axis=-1)


def pieces_between(inner: Floats, outer: Floats) -> list[Floats]:
    """Corners (8, 3) of the pieces of a wall between rings (R, S, 3), ring by ring."""
    pieces = []
    for low in range(len(inner) - 1):
        for k in range(inner.shape[1]):
            corners = [k, (k + 1) % inner.shape[1]]
            sides = [ring[low : low + 2, corners].reshape(-1, 3) for ring in (inner, outer)]
            pieces.append(np.concatenate(sides))
    return pieces


def close_rings(rings: Floats) -> trimesh.Trimesh:
    """Join rings (R, S, 3) [m] to a tube and close both ends with fans.

    Each ring is counter-clockwise seen from the last one.
    """
    vertices = np.concatenate([rings.reshape(-1, 3), rings[[0, -1]].mean(1)])
    return trimesh.Trimesh(vertices, closed_tube_faces(*rings.shape[:2]), process=False)


def swept_tube(path: Floats, radius_m: float, end_tangent: Floats) -> Floats:
    """Rings (P, S, 3) of a round tube along a path (P, 3) [m] in the plane y = 0.

    Each ring is counter-clockwise seen from the one before. At its start the tube has the direction
    `end_tangent` (3,), at its end the opposite one.
    """
    tangents = np.gradient(path, axis=0)
    tangents[0], tangents[-1] = end_tangent, -end_tangent
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    across = np.array([0.0, 1.0, 0.0])
    beside = np.cross(across, tangents)
    angles = np.arange(TUBE_CORNERS) * 2.0 * np.pi / TUBE_CORNERS
    circle = np.cos(angles)[:, None, None] * beside + np.sin(angles)[:, None, None] * across
    return path[:, None] + radius_m * circle.transpose(1, 0, 2)

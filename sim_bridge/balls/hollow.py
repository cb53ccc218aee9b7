# SPDX-License-Identifier: Apache-2.0
"""The inside of a container as rings of points, and which balls are in it.

Points are in the frame of the `Container`, in metres: z up, the base in the plane z = 0.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from intent_recognition.array_types import Floats
from sim_bridge.containers import Container

N_HEIGHTS, N_CORNERS = 7, 32
"""Number of heights at which the inner outline is sampled, and number of corners at each."""


@dataclass(frozen=True)
class Hollow:
    """The inner wall of a container.

    Every ring is a convex polygon at one height, counter-clockwise seen from above. Corners with
    the same index lie in the same direction on all rings.
    """

    rings_m: Floats  # (S, K, 2) corners of the inner wall, from the floor up
    heights_m: Floats  # (S,) ascending; the first is the inner floor, the last the rim

    @property
    def rim_height_m(self) -> float:
        """Height of the rim in the container's frame."""
        return float(self.heights_m[-1])

    @property
    def volume_m3(self) -> float:
        """Volume below the rim: areas of the rings, integrated by the prismoidal rule."""
        middle = _areas(0.5 * (self.rings_m[1:] + self.rings_m[:-1]))
        areas = _areas(self.rings_m)
        mean = (areas[1:] + 4.0 * middle + areas[:-1]) / 6.0
        return float(np.sum(mean * np.diff(self.heights_m)))

    def lip_m(self, direction: Floats) -> Floats:
        """Point (3,) of the rim that is farthest in a horizontal direction (2,)."""
        rim = self.rings_m[-1]
        return np.append(rim[np.argmax(rim @ np.asarray(direction))], self.rim_height_m)

    def clearance_m(self, points_m: Floats) -> Floats:
        """Horizontal distance of points (N, 3) from the inner wall, negative outside it, (N,).

        Above the rim, the last ring is used; below the floor, the first.
        """
        heights = self.heights_m
        z = np.clip(points_m[:, 2], heights[0], heights[-1])
        low = np.clip(np.searchsorted(heights, z, side="right") - 1, 0, len(heights) - 2)
        share = ((z - heights[low]) / (heights[low + 1] - heights[low]))[:, None]
        x, y, along_x, along_y = (
            table[low] + share * (table[low + 1] - table[low]) for table in self._tables
        )
        across = along_x * (points_m[:, 1:2] - y) - along_y * (points_m[:, :1] - x)
        return np.min(across / np.sqrt(along_x**2 + along_y**2), axis=1)

    @cached_property
    def _tables(self) -> tuple[Floats, ...]:
        """Corners' x and y, and the edges that begin there, (S, K) each."""
        edges = np.roll(self.rings_m, -1, axis=1) - self.rings_m
        both = np.concatenate([self.rings_m, edges], axis=-1)
        return tuple(np.ascontiguousarray(both[..., column]) for column in range(4))

    def holds(self, points_m: Floats) -> Floats:
        """Whether points (N, 3) are inside, between floor and rim, (N,)."""
        z = points_m[:, 2]
        between = (z >= self.heights_m[0]) & (z < self.rim_height_m)
        return between & (self.clearance_m(points_m) >= 0.0)

    def grown(self, by_m: float) -> "Hollow":
        """The same hollow with walls and floor farther out by `by_m`; the rim keeps its height."""
        heights = self.heights_m.copy()
        heights[0] -= by_m
        return replace(self, rings_m=offset(self.rings_m, by_m), heights_m=heights)


def hollow_of(container: Container) -> Hollow:
    """The inner wall of a container with fewer rings and corners, including the crest."""
    sections = container.sections
    body = len(sections.heights_m) - 1
    wanted = np.linspace(sections.heights_m[0], sections.heights_m[-2], N_HEIGHTS - 1)
    rows = {int(np.argmin(np.abs(sections.heights_m[:body] - height))) for height in wanted}
    chosen = [*sorted(rows), body]
    every = sections.inner.shape[1] // N_CORNERS
    return Hollow(sections.inner[chosen][:, ::every], sections.heights_m[chosen])


def offset(rings_m: Floats, by_m: float) -> Floats:
    """Rings (..., K, 2) with every edge moved outward by `by_m`; corners stay corners."""
    edges = np.roll(rings_m, -1, axis=-2) - rings_m
    outward = np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
    outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
    before = np.roll(outward, 1, axis=-2)
    corner = before + outward
    return rings_m + 2.0 * by_m * corner / np.sum(corner**2, axis=-1, keepdims=True)


def _areas(rings_m: Floats) -> Floats:
    """Signed areas (...,) of polygons (..., K, 2), positive if counter-clockwise."""
    after = np.roll(rings_m, -1, axis=-2)
    cross = rings_m[..., 0] * after[..., 1] - rings_m[..., 1] * after[..., 0]
    return 0.5 * np.sum(cross, axis=-1)

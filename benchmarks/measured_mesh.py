# SPDX-License-Identifier: Apache-2.0
"""What is true of a container's mesh, measured from its free space and from nothing else.

The free space below the plane of the rim is filled with small cubes; those connected with the
middle of the opening are the cavity. Pinholes, as scans of thin plastic have, are plugged first.
Serves scanned containers, and as an independent answer for the parametric ones.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy import ndimage
from scipy.optimize import brentq

from intent_recognition.array_types import Flags, Floats
from intent_recognition.errors import ArgumentError

N_SECTORS = 72
"""Directions in which the crest is looked for."""
CREST_M = 0.0006
"""Vertices so near to the highest one in their sector belong to the crest [m]."""
PINHOLE_M2 = 1e-4
"""Holes of a mesh smaller than this are closed [m^2]."""
CUBES_M = (0.001, 0.0005)
"""Edges of cubes in which a volume is counted [m]: coarse, then fine for small containers."""


@dataclass(frozen=True)
class MeasuredMesh:
    """Measures of an upright mesh, in its own coordinates.

    Attributes:
        opening_radius_m: mean distance of the crest from its centre, over directions.
        height_m: from the lowest point to the crest.
        volume_m3: free space below the plane of the crest.
        opening_centre: (3,) [m].
        crest: highest points (72, 3) all around [m].
        cubes: centres (n, 3) of the cubes of the free space [m].
        cube_m: their edge.
    """

    opening_radius_m: float
    height_m: float
    volume_m3: float
    opening_centre: Floats
    crest: Floats
    cubes: Floats
    cube_m: float

    def tilt_reference_about(self, lip: Floats) -> float:
        """Tilt [rad] about a lip (3,) after which half of the cubes are above it."""
        outward = (lip - self.opening_centre) * [1.0, 1.0, 0.0]
        outward /= np.linalg.norm(outward)

        def surplus(angle: float) -> float:
            height = (self.cubes - lip) @ (
                np.cos(angle) * np.array([0.0, 0.0, 1.0]) - np.sin(angle) * outward
            )
            # A cube that is cut counts by its share, so that the answer is smooth.
            return float(np.clip(0.5 - height / self.cube_m, 0.0, 1.0).mean()) - 0.5

        return float(brentq(surplus, 0.0, 3.0, xtol=1e-4))

    def lip_toward(self, point: Floats) -> Floats:
        """Crest point (3,) closest to a place (3,), at the mean height of the crest."""
        nearest = np.argmin(np.linalg.norm(self.crest[:, :2] - np.asarray(point)[:2], axis=1))
        return np.array([*self.crest[nearest, :2], self.opening_centre[2]])


def measure_mesh(mesh: trimesh.Trimesh) -> MeasuredMesh:
    """Measure an upright, watertight container.

    Args:
        mesh: in metres, z up.

    Raises:
        ArgumentError: there is no free space under its top that does not run out.
    """
    crest = _crest(mesh)
    centre = 0.5 * (crest[:, :2].min(0) + crest[:, :2].max(0))
    for _ in range(3):
        centre = centre + _offset(crest[:, :2] - centre)
    level, lowest = float(crest[:, 2].mean()), float(crest[:, 2].min())
    for cube_m in CUBES_M:
        cubes = _free_space(mesh, np.array([*centre, lowest]), cube_m)
        if len(cubes):
            break
    else:
        cure = "Its top is closed, or it has a hole."
        got = "none that stays inside"
        raise ArgumentError.about("mesh", "free space under the rim", got, cure)
    # Between the lowest point of the crest and its mean there is a disc more.
    rim_cubes = (cubes[:, 2] > lowest - 2.0 * cube_m).sum() / 2.0
    missing = rim_cubes * cube_m**2 * (level - lowest)
    return MeasuredMesh(
        opening_radius_m=float(np.linalg.norm(crest[:, :2] - centre, axis=1).mean()),
        height_m=level - float(mesh.bounds[0, 2]),
        volume_m3=len(cubes) * cube_m**3 + missing,
        opening_centre=np.array([*centre, level]),
        crest=crest,
        cubes=cubes,
        cube_m=cube_m,
    )


def _crest(mesh: trimesh.Trimesh) -> Floats:
    """Mean (72, 3) of the highest points of each sector around the opening."""
    points, _ = trimesh.sample.sample_surface(mesh, 400_000, seed=0)
    top = points[points[:, 2] > mesh.bounds[1, 2] - 0.1 * np.ptp(mesh.bounds[:, 2])]
    middle = 0.5 * (top[:, :2].min(0) + top[:, :2].max(0))
    for _ in range(2):
        flat = top[:, :2] - middle
        turn = np.arctan2(flat[:, 1], flat[:, 0]) / (2.0 * np.pi) + 0.5
        sector = (turn * N_SECTORS).astype(int) % N_SECTORS
        highest = np.full(N_SECTORS, -np.inf)
        np.maximum.at(highest, sector, top[:, 2])
        near = top[:, 2] > highest[sector] - CREST_M
        count = np.bincount(sector[near], minlength=N_SECTORS)
        if not count.all():
            cure = "Stand the mesh upright, z up."
            raise ArgumentError.about("mesh", "a rim all around its top", "gaps", cure)
        sums = [np.bincount(sector[near], top[near, axis], N_SECTORS) for axis in range(2)]
        crest = np.column_stack([*(total / count for total in sums), highest])
        middle = middle + _offset(crest[:, :2] - middle)
    return crest


def _offset(flat: Floats) -> Floats:
    """Offset (2,) of the true centre, from points (n, 2) all around an assumed one."""
    radius = np.linalg.norm(flat, axis=1)
    return 2.0 * (flat - flat / radius[:, None] * radius.mean()).mean(0)


def _free_space(mesh: trimesh.Trimesh, below: Floats, cube_m: float) -> Floats:
    """Centres (n, 3) of the cubes below a point and connected with it; none if they run out."""
    low, high = mesh.bounds
    start = low - 2.5 * cube_m
    shape = np.ceil((np.array([*high[:2], below[2]]) - start) / cube_m).astype(int)
    shape[:2] += 3
    tops = below[2] - (np.arange(shape[2])[::-1] + 0.5) * cube_m
    columns = start[:2] + (np.indices(shape[:2]).reshape(2, -1).T + 0.5) * cube_m
    origins = np.column_stack([columns, np.full(len(columns), high[2] + 0.01)])
    downward = np.tile([0.0, 0.0, -1.0], (len(columns), 1))
    hits, ray, face = mesh.ray.intersects_location(origins, downward, multiple_hits=True)
    # Going down, a face turned up leads into the body and one turned down out of it.
    change = np.zeros((len(columns), shape[2] + 1))
    index = np.searchsorted(tops, hits[:, 2])
    sign = np.where(mesh.face_normals[face, 2] > 0.0, 1.0, -1.0)
    np.add.at(change, (ray, index), sign)
    solid = np.cumsum(change[:, ::-1], axis=1)[:, ::-1][:, 1:] > 0.5
    solid = _plugged(solid.reshape(shape), cube_m)
    pieces, _ = ndimage.label(~solid)
    seed = ((below[:2] - start[:2]) / cube_m).astype(int)
    piece = pieces[seed[0], seed[1], -1]
    if piece == 0 or piece == pieces[0, 0, 0]:
        return np.zeros((0, 3))
    rows = np.argwhere(pieces == piece)
    return np.column_stack([start[:2] + (rows[:, :2] + 0.5) * cube_m, tops[rows[:, 2]]])


def _plugged(solid: Flags, cube_m: float) -> Flags:
    """Cubes where columns through a pinhole are like their neighbours."""
    through: Flags = ~np.any(solid, axis=2)
    pieces, n = ndimage.label(through)
    sizes = ndimage.sum(through, pieces, np.arange(n + 1)) * cube_m**2
    pinhole = through & (sizes[pieces] < PINHOLE_M2) & (pieces != pieces[0, 0])
    _, nearest = ndimage.distance_transform_edt(through, return_indices=True)
    plugged = solid.copy()
    plugged[pinhole] = solid[nearest[0][pinhole], nearest[1][pinhole]]
    return plugged

# SPDX-License-Identifier: Apache-2.0
"""Point clouds of a mesh as seen by a depth camera, with noise."""

from dataclasses import dataclass

import numpy as np
import trimesh

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError


@dataclass(frozen=True)
class Camera:
    """Position and noise of a depth camera that looks at an object."""

    distance_m: float = 0.7  # distance from the middle of the object
    # range of the elevation above the horizon, drawn for each view
    elevation_rad: tuple[float, float] = (0.8, 1.1)
    depth_noise_std_m: float = 0.0007  # noise of each depth, along its ray
    normal_noise_std_rad: float = 0.08  # noise of each normal about each axis across it
    grazing_rad: float = 0.17  # surfaces seen at a smaller angle give no depth


@dataclass(frozen=True)
class SurfaceScan:
    """Points (n, 3) [m] with outward normals (n, 3), and camera positions for each (n, 3) [m]."""

    points: Floats
    normals: Floats
    viewpoints: Floats


def scan(
    mesh: trimesh.Trimesh,
    rng: np.random.Generator,
    n_views: int = 3,
    n_points: int = 2000,
    camera: Camera | None = None,
) -> SurfaceScan:
    """Scan a mesh from above, from views spread evenly around it.

    A ray goes through every pixel; the camera sees the first surface that the ray meets. The mesh
    is in metres, z up, wound outward. The cloud is in the mesh's frame and holds `n_points` of all
    views together.

    Raises:
        ArgumentError: fewer than `n_points` points are visible.
    """
    camera = camera or Camera()
    centre = mesh.bounds.mean(0)
    radius = 0.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    start = rng.uniform(0.0, 2.0 * np.pi)
    views = []
    for view in range(n_views):
        azimuth = start + 2.0 * np.pi * view / n_views
        elevation = rng.uniform(*camera.elevation_rad)
        level = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        eye = centre + camera.distance_m * (level + [0.0, 0.0, np.sin(elevation)])
        views.append(_view(mesh, eye, centre, radius, 6 * n_points // n_views, camera))
    points, normals, eyes = (np.concatenate(parts) for parts in zip(*views, strict=True))
    if len(points) < n_points:
        cure = "Take fewer points or a smaller distance."
        raise ArgumentError.about("n_points", f"at most {len(points)}", n_points, cure)
    kept = np.sort(rng.choice(len(points), n_points, replace=False))
    points, normals, eyes = points[kept], normals[kept], eyes[kept]
    rays = points - eyes
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    points = points + rays * rng.normal(0.0, camera.depth_noise_std_m, (n_points, 1))
    normals = normals + rng.normal(0.0, camera.normal_noise_std_rad, (n_points, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return SurfaceScan(points, normals, eyes)


def _view(
    mesh: trimesh.Trimesh, eye: Floats, centre: Floats, radius: float, n_rays: int, camera: Camera
) -> tuple[Floats, Floats, Floats]:
    """Points, normals and the eye for each pixel that sees a surface."""
    ahead = (centre - eye) / np.linalg.norm(centre - eye)
    aside = np.cross(ahead, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    side = int(np.ceil(np.sqrt(n_rays)))
    offsets = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    across, along = (radius * grid.ravel() for grid in np.meshgrid(offsets, offsets))
    targets = centre + across[:, None] * aside + along[:, None] * np.cross(aside, ahead)
    rays = targets - eye
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    eyes = np.tile(eye, (len(rays), 1))
    points, ray, face = mesh.ray.intersects_location(eyes, rays, multiple_hits=False)
    normals = mesh.face_normals[face]
    seen = -np.einsum("ij,ij->i", normals, rays[ray]) > np.sin(camera.grazing_rad)
    return points[seen], normals[seen], eyes[ray][seen]

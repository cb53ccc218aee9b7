# SPDX-License-Identifier: Apache-2.0
"""Reads the targets of warping, meshes or clouds, from files."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, IntentError, optional
from intent_recognition.untrusted import LARGEST, MOST_MESH, check_regular
from intent_recognition.warping import LEAST_M, ObjectCloud, with_estimated_normals

if TYPE_CHECKING:
    import trimesh

N_POINTS = 4000
"""Number of points of a cloud that is warped; a few millimetres apart on a cup."""
N_SURFACE_POINTS = 100_000
"""Number of surface points to which distances are measured; under 1 mm apart on a cup."""
MOSTLY_SOLID = 0.8
"""Share of its convex hull above which a mesh counts as closed on top; a container with walls fills
less."""
APART = 0.05
"""Largest share of a mesh's area in separate bodies that are left out as specks of a scan; a larger
share is another object."""
SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".xyz")
"""File types that are read; trimesh's other types are archives and XML, which may never end."""
NEEDED = "a mesh file (.obj, .ply, .stl, .off, .glb, .gltf) or a cloud (.ply, .xyz)"


@dataclass(frozen=True)
class Target:
    """An object onto which an annotated one is warped."""

    cloud: ObjectCloud  # points of its surface
    # dense points on the whole surface; None for a cloud, which never shows all sides
    surface: ObjectCloud | None
    # thickness of the wall, measured below the surface [m]; 0 for a single surface without a wall,
    # NaN for a cloud
    wall_m: float = float("nan")


def load_target(
    path: str | Path,
    n_points: int = N_POINTS,
    scale: float = 1.0,
    viewpoint: Floats | None = None,
    seed: int = 0,
) -> Target:
    """Read a mesh or a cloud; `scale` converts to metres, such as 0.001 for millimetres.

    Clouds without normals need `viewpoint`, the position of the camera (3,) [m].

    Raises:
        ArgumentError: the file cannot be read, or its content is not an open container.
    """
    trimesh = optional("trimesh")

    place = str(path)
    if not Path(path).is_file():
        raise ArgumentError.about(place, NEEDED, "no file", "Check the path.")
    if (suffix := Path(path).suffix.lower()) not in SUFFIXES:
        raise ArgumentError.about(place, NEEDED, suffix or "neither", "Export it as one.")
    if Path(path).stat().st_size > MOST_MESH:
        got = f"a file of more than {MOST_MESH} bytes"
        raise ArgumentError.about(place, NEEDED, got, "Export fewer triangles.")
    try:
        # Files may lack material values, with which trimesh then computes.
        with np.errstate(invalid="ignore"):
            # No materials or textures: they may refer to any file, also an endless one. Processing
            # would drop triangles with vertices that are NaN.
            options = {"skip_materials": True, "process": False}
            loaded = trimesh.load(place, resolver=_buffers(place), **options)
    except Exception as error:  # each reader of trimesh has its own errors
        got = f"{type(error).__name__}: {error}"
        raise ArgumentError.about(place, NEEDED, got, "Export it again.") from error
    try:
        if isinstance(loaded, trimesh.PointCloud):
            return Target(_cloud(loaded, n_points, scale, viewpoint, seed), None)
        return mesh_target(_one_mesh(place, loaded), n_points, scale, seed)
    except IntentError as error:
        raise type(error)(f"{place}: {error}") from error
    except (ValueError, TypeError, LookupError, ArithmeticError, AttributeError) as error:
        got = f"one that cannot be used: {error}"
        raise ArgumentError.about(place, NEEDED, got, "Export it again.") from error


def _buffers(place: str) -> "trimesh.resolvers.FilePathResolver":
    """Resolver of a glTF's buffers: only regular files beside it, of bounded size."""
    trimesh = optional("trimesh")

    class Buffers(trimesh.resolvers.FilePathResolver):  # type: ignore[name-defined]
        def get(self, name: str) -> bytes:
            path = Path(self.parent, name)
            check_regular(path, MOST_MESH)
            return path.read_bytes()

    return Buffers(place)


def mesh_target(
    mesh: "trimesh.Trimesh", n_points: int = N_POINTS, scale: float = 1.0, seed: int = 0
) -> Target:
    """Sample a mesh evenly over its surface; `scale` converts to metres.

    Triangles are turned outward if needed. A surface without a wall is sampled on both sides.

    Raises:
        ArgumentError: the mesh has no area, vertices that are not finite, a closed body, or
            triangles that cannot be oriented consistently.
    """
    trimesh = optional("trimesh")

    vertices, faces = np.array(mesh.vertices, dtype=float) * scale, np.array(mesh.faces)
    if not len(faces):
        raise ArgumentError.about("mesh", "triangles", "none", "Export the mesh again.")
    used = vertices[np.unique(faces)]
    _check_size("vertices", used)
    solid = trimesh.Trimesh(vertices, faces, process=False)
    # Scans repeat vertices along the seams of their textures.
    with np.errstate(invalid="ignore"):
        solid.merge_vertices(merge_tex=True, merge_norm=True)
    if not solid.area > 0.0:
        raise ArgumentError.about("mesh", "an area above 0", solid.area, "Export it again.")
    _leave_out_apart(solid)
    _wind(solid)
    share = _hull_share(solid)
    is_sheet = share > MOSTLY_SOLID and _is_sheet(solid)
    if share > MOSTLY_SOLID and not is_sheet:
        got = f"a body that fills {100.0 * share:.0f} % of its convex hull"
        cure = "It is closed on top: open it in a mesh editor, or scan it without its lid."
        raise ArgumentError.about("mesh", "a container with an open top", got, cure)
    if is_sheet:  # two sides, no thickness
        both = np.concatenate([solid.faces, solid.faces[:, ::-1]])
        solid = trimesh.Trimesh(solid.vertices, both, process=False)
    points, face = trimesh.sample.sample_surface(solid, N_SURFACE_POINTS, seed=seed)
    surface = ObjectCloud(points, solid.face_normals[face])
    wall_m = 0.0 if is_sheet else _wall_m(solid, points[:1000], face[:1000])
    kept = slice(None, None, max(1, N_SURFACE_POINTS // n_points))
    cloud = ObjectCloud(surface.points[kept][:n_points], surface.normals[kept][:n_points])
    return Target(cloud, surface, wall_m)


def _leave_out_apart(solid: "trimesh.Trimesh") -> None:
    """Keep the largest body and bodies whose boxes overlap the kept ones', such as a handle."""
    trimesh = optional("trimesh")

    nodes = np.arange(len(solid.faces))
    bodies = trimesh.graph.connected_components(solid.face_adjacency, nodes=nodes, min_len=1)
    lows = np.array([solid.triangles[body].min((0, 1)) for body in bodies])
    highs = np.array([solid.triangles[body].max((0, 1)) for body in bodies])
    areas = np.array([solid.area_faces[body].sum() for body in bodies])
    kept, n_kept = areas == areas.max(), 0
    while n_kept < kept.sum():
        n_kept = kept.sum()
        low, high = lows[kept].min(0), highs[kept].max(0)
        kept |= np.all((lows <= high) & (highs >= low), axis=1)
    if kept.all():
        return
    if areas[~kept].sum() > APART * areas.sum():
        got = f"{np.count_nonzero(~kept)} beside it"
        raise ArgumentError.about("mesh", "one object", got, "Export one at a time.")
    solid.update_faces(np.sort(np.concatenate([bodies[k] for k in np.flatnonzero(kept)])))
    solid.remove_unreferenced_vertices()


def _wind(solid: "trimesh.Trimesh") -> None:
    trimesh = optional("trimesh")

    if not solid.is_winding_consistent:
        trimesh.repair.fix_winding(solid)
        if not solid.is_winding_consistent:
            cure = "Make its normals consistent in a mesh editor, all outward."
            got = "some that cannot be turned"
            raise ArgumentError.about("mesh", "triangles that all face outward", got, cure)
    if solid.is_watertight and solid.body_count > 1:
        trimesh.repair.fix_inversion(solid, multibody=True)
    elif solid.volume < 0.0:
        solid.invert()


def _hull_share(solid: "trimesh.Trimesh") -> float:
    """Volume as a share of the convex hull's; 0 without a hull."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(solid.vertices).volume
    except QhullError:
        return 0.0
    return float(solid.volume / hull) if hull > 0.0 else 0.0


def _is_sheet(solid: "trimesh.Trimesh") -> bool:
    uses = np.bincount(solid.edges_unique_inverse)
    rim_m = float(solid.edges_unique_length[uses == 1].sum())
    # a round rim as wide as its cup is high gives 1.8; holes of scans are shorter
    return rim_m > 0.5 * float(solid.scale)


def _wall_m(solid: "trimesh.Trimesh", points: NDArray, faces: NDArray) -> float:
    """Median thickness of the wall [m] below surface points (n, 3) on `faces` (n,)."""
    inward = -solid.face_normals[faces]
    hits, rays, _ = solid.ray.intersects_location(
        points + inward * 1e-6 * solid.scale,  # above rounding
        inward,
        multiple_hits=False,
    )
    if not len(hits):
        return float("nan")
    return float(np.median(np.linalg.norm(hits - points[rays], axis=1)))


def _check_size(argument: str, points: Floats) -> None:
    bad = ~np.all(np.abs(points) <= LARGEST, axis=1)
    if bad.any():
        got = f"{np.count_nonzero(bad)} with NaN or infinity, or beyond {LARGEST:g} m"
        raise ArgumentError.about(argument, "finite ones", got, "Repair the file.")
    extent_m = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    if extent_m < LEAST_M:
        expected = f"an object of {LEAST_M:g} m or more"
        raise ArgumentError.about(argument, expected, f"{extent_m:g} m", "Check the scale.")


def _one_mesh(place: str, loaded: object) -> "trimesh.Trimesh":
    trimesh = optional("trimesh")

    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_mesh() if loaded.geometry else trimesh.Trimesh()
    if not isinstance(loaded, trimesh.Trimesh):
        got = f"a {type(loaded).__name__}"
        raise ArgumentError.about(place, NEEDED, got, "Export triangles or points.")
    return loaded


def _cloud(
    loaded: "trimesh.PointCloud", n_points: int, scale: float, viewpoint: Floats | None, seed: int
) -> ObjectCloud:
    points = np.array(loaded.vertices, dtype=float) * scale
    _check_size("points", points)
    normals = _file_normals(loaded, len(points))
    if len(points) > n_points:
        kept = np.sort(np.random.default_rng(seed).choice(len(points), n_points, replace=False))
        points, normals = points[kept], None if normals is None else normals[kept]
    if normals is not None:
        return ObjectCloud(points, normals)
    return with_estimated_normals(points, viewpoint)


def _file_normals(loaded: "trimesh.PointCloud", n: int) -> Floats | None:
    raw = loaded.metadata.get("_ply_raw", {}).get("vertex", {}).get("data")
    try:
        normals = np.column_stack([np.ravel(raw[name]) for name in ("nx", "ny", "nz")])
    except (KeyError, ValueError, TypeError, IndexError):
        return None
    return normals.astype(float) if normals.shape == (n, 3) else None

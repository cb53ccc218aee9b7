# SPDX-License-Identifier: Apache-2.0
"""Clouds and meshes that cannot be warped onto are refused with the reason."""

import re

import numpy as np
import pytest
import trimesh
from scan_builder import scanned

from intent_recognition.errors import ArgumentError, ShapeError, TrainingError
from intent_recognition.objects.targets import load_target, mesh_target
from intent_recognition.warping.object_model import (
    AnnotatedObject,
    ObjectCloud,
    with_estimated_normals,
)
from intent_recognition.warping.object_warp import ObjectModel, warp_object
from intent_recognition.warping.parameters import pouring_parameters
from intent_recognition.warping.wall_checks import _holes, check_wall
from sim_bridge.containers import make_container, scan


def mug_mesh() -> trimesh.Trimesh:
    return make_container("mug", 3).mesh.copy()


@pytest.mark.parametrize(
    ("points", "normals", "error", "reason"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3)), ArgumentError, "at least 100, got 0"),
        (np.zeros((200, 2)), np.zeros((200, 2)), ShapeError, "shape"),
        (
            np.r_[[[np.nan] * 3], np.ones((199, 3))],
            np.ones((200, 3)),
            ArgumentError,
            "1 of 200 with",
        ),
        (np.zeros((200, 3)), np.zeros((199, 3)), ShapeError, "normals"),
        (np.zeros((200, 3)), np.zeros((200, 3)), ArgumentError, "normals: expected finite"),
    ],
)
def test_bad_arrays(points, normals, error, reason):
    with pytest.raises(error, match=reason):
        ObjectCloud(points, normals)


@pytest.mark.parametrize("few", [1, 2, 5])
def test_normals_of_points_that_a_camera_sees_few_of_are_those_of_the_surface(few, rng):
    ball = rng.normal(size=(2000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    eyes = np.tile([0.0, 0.0, 9.0], (len(ball), 1))
    eyes[:few] = [9.0, 0.0, 0.0]
    found = with_estimated_normals(ball, eyes).normals
    assert np.abs((found * ball).sum(1)).min() > 0.9


def test_clouds_that_are_no_container(mug):
    """Wrong unit, flat, two objects, none."""
    cloud = scanned("tumbler")
    rng = np.random.default_rng(0)
    flat = ObjectCloud(rng.uniform(0, 0.1, (500, 3)) * [1, 1, 0], np.tile([0, 0, 1.0], (500, 1)))
    ball = rng.normal(size=(1000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    two = ObjectCloud(
        np.concatenate([cloud.points, cloud.points + [0.2, 0, 0]]), np.tile(cloud.normals, (2, 1))
    )
    for bad, reason in (
        (ObjectCloud(1000.0 * cloud.points, cloud.normals), "millimetres are scaled by 0.001"),
        (flat, "a body with a depth"),
        (two, "2 pieces"),
        (ObjectCloud(0.05 * ball, ball), "open rim"),
    ):
        with pytest.raises(ArgumentError, match=reason):
            warp_object(mug, bad)


def test_walls_that_only_a_thin_rim_joins_are_one_object(mug):
    """In one view of a paper cup the near outside and the far inside touch at the rim alone."""
    cup = make_container("paper_cup", 204)
    seen = scan(cup.mesh, np.random.default_rng(204), 1)
    found = pouring_parameters(warp_object(mug, ObjectCloud(seen.points, seen.normals)))
    assert found.volume_m3 == pytest.approx(cup.inner_volume_m3, rel=0.05)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_hole_in_the_wall_is_found_at_its_height(mug, share):
    mesh = mug_mesh()
    top, centres = mesh.bounds[1, 2], mesh.triangles_center
    from_middle = np.abs(centres - [0.0, 0.0, share * top])
    window = (centres[:, 0] > 0.0) & np.all(from_middle[:, 1:] < 0.012, axis=1)
    mesh.update_faces(~window)
    target = mesh_target(mesh)
    with pytest.raises(ArgumentError, match="a hole about") as error:
        check_wall(warp_object(mug, target.cloud), target.surface)
    (level_mm,) = re.findall(r"about (\d+) mm", str(error.value))
    assert int(level_mm) == pytest.approx(1e3 * (1.0 - share) * top, abs=6.0)


def test_the_belly_of_a_vase_is_no_hole(mug):
    share = np.linspace(0.0, 1.0, 40)
    belly = 0.045 * np.sqrt(np.maximum(1.0 - (0.9 * (share / 0.35 - 1.0)) ** 2, 0.05))
    outside = np.column_stack([np.where(share < 0.7, belly, 0.03), 0.18 * share])
    inside = outside - [0.003, 0.0]
    inside[0, 1] = 0.004
    cavity = [*inside[::-1], (0.0, 0.004)]
    target = mesh_target(trimesh.creation.revolve([(0.0, 0.0), *outside, *cavity], sections=96))
    warped = warp_object(mug, target.cloud)
    check_wall(warped, target.surface)
    held = trimesh.creation.revolve([(0.0, 0.18), *cavity], sections=96)
    assert pouring_parameters(warped).volume_m3 == pytest.approx(abs(held.volume), rel=0.05)


@pytest.mark.slow
def test_meshes_that_hold_nothing(mug):
    """Closed, lidded, without a floor, in millimetres, empty, with NaN."""
    mesh = mug_mesh()
    tall, glasses = make_container("tall_glass", 3), []
    fine = tall.mesh.copy()
    for _ in range(3):
        floor = np.linalg.norm(fine.triangles_center[:, :2], axis=1) < 0.02
        fine = fine.subdivide(face_index=np.flatnonzero(floor))
    for share in (0.5, 0.95):  # of the middle of the floor, a third of the rim wide, is a hole
        glass, hole_m = fine.copy(), share * 0.35 * tall.opening_radius_m
        glass.update_faces(np.linalg.norm(glass.triangles_center[:, :2], axis=1) > hole_m)
        glasses.append(mesh_target(glass))
    check_wall(warp_object(mug, glasses[0].cloud), glasses[0].surface)
    lid = trimesh.creation.cylinder(radius=0.041, height=0.004)
    lid.apply_translation([0.0, 0.0, mesh.bounds[1, 2]])
    lidded = trimesh.util.concatenate([mesh, lid])
    large = mug_mesh()
    large.apply_scale(1000.0)
    nan = trimesh.Trimesh(np.full((3, 3), np.nan), [[0, 1, 2]], process=False)
    for bad, reason in (
        (trimesh.creation.box((0.1, 0.1, 0.1)), "closed on top"),
        (lidded, "closed on top"),
        (glass, "a hole in the floor"),
        (large, "millimetres"),
        (trimesh.Trimesh(), "triangles"),
        (nan, "NaN"),
    ):
        with pytest.raises(ArgumentError, match=reason):
            target = mesh_target(bad)
            check_wall(warp_object(mug, target.cloud), target.surface)


@pytest.mark.slow
def test_files(mug, tmp_path):
    """What trimesh can write is read; what it cannot read, or is not there, is named."""
    mesh = make_container("tea_cup", 2)
    for ending in ("obj", "ply", "stl"):
        path = tmp_path / f"cup.{ending}"
        mesh.mesh.export(path)
        target = load_target(path)
        check_wall(warp_object(mug, target.cloud), target.surface)
        found = pouring_parameters(warp_object(mug, target.cloud))
        assert found.volume_m3 == pytest.approx(mesh.inner_volume_m3, rel=0.03)
    (tmp_path / "bad.stl").write_bytes(b"solid nonsense")
    (tmp_path / "bad.xyzzy").write_bytes(b"?")
    for name in ("bad.stl", "bad.xyzzy", "none.ply"):
        with pytest.raises(ArgumentError, match=name):
            load_target(tmp_path / name)


def test_a_cloud_without_normals_needs_the_camera(mug, tmp_path):
    container = make_container("tumbler", 1)
    seen = scan(container.mesh, np.random.default_rng(0), 1)
    path = tmp_path / "seen.ply"
    trimesh.PointCloud(seen.points).export(path)
    with pytest.raises(ArgumentError, match="positions of the camera"):
        load_target(path)
    found = pouring_parameters(
        warp_object(mug, load_target(path, viewpoint=seen.viewpoints[0]).cloud)
    )
    assert found.opening_radius_m == pytest.approx(container.opening_radius_m, rel=0.04)
    assert found.volume_m3 == pytest.approx(container.inner_volume_m3, rel=0.15)


def test_estimated_normals_point_out_of_the_surface():
    """Against those of the mesh, in several views."""
    seen = scan(make_container("round_bowl").mesh, np.random.default_rng(0), 3)
    cloud = with_estimated_normals(seen.points, seen.viewpoints)
    agreement = (cloud.normals * seen.normals).sum(1)
    assert np.median(agreement) > 0.95
    assert (agreement > 0.0).mean() > 0.97
    with pytest.raises(ShapeError, match="viewpoints"):
        with_estimated_normals(seen.points, seen.viewpoints[:5])


def test_annotations_are_checked(mug):
    own = mug.annotated
    with pytest.raises(ArgumentError, match="values of Part"):
        AnnotatedObject(own.points, own.normals, np.full(len(own.points), 7))
    with pytest.raises(ShapeError, match="labels"):
        AnnotatedObject(own.points, own.normals, own.labels[:-1])
    with pytest.raises(TrainingError, match="RIM"):
        ObjectModel.learn(AnnotatedObject(own.points, own.normals, np.zeros(len(own.points))))


@pytest.mark.parametrize("pair", [[(2, 5), (2, 6)], [(3, 0), (3, 47)], [(1, 9), (2, 9)]])
def test_a_hole_is_two_empty_cells_beside_or_above_each_other_where_others_are_full(pair):
    cells = np.full((6, 48), 20)
    cells[tuple(np.transpose(pair))] = 0
    assert [*map(tuple, np.argwhere(_holes(cells)))] == pair
    assert not _holes(cells // 2).any()
    cells[pair[0]] = 20
    assert not _holes(cells).any()

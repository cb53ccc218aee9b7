# SPDX-License-Identifier: Apache-2.0
"""Meshes as tools export them: wound to both sides, or without a wall."""

import numpy as np
import pytest

from intent_recognition.errors import ArgumentError
from intent_recognition.objects import find_object, load_object, load_target
from intent_recognition.warping import ObjectModel, Part, pouring_parameters, warp_object

trimesh = pytest.importorskip("trimesh")
RADIUS_M, DEPTH_M, WALL_M = 0.037, 0.095, 0.003
VOLUME_M3 = np.pi * RADIUS_M**2 * DEPTH_M


def cup(wall_m):
    """A cup that is straight inside, by its profile."""
    profile = [(0.0, 0.0), (RADIUS_M, 0.0), (RADIUS_M, DEPTH_M)]
    outside = RADIUS_M + wall_m
    if wall_m:
        profile += [(outside, DEPTH_M), (outside, -wall_m), (0.0, -wall_m)]
    return trimesh.creation.revolve(np.array(profile), sections=96)


def flipped(mesh):
    """Every second triangle is wound the other way."""
    faces = mesh.faces.copy()
    faces[::2] = faces[::2, ::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def beside(mesh, size_m=0.01):
    """A box stands beside it, apart from it."""
    box = trimesh.creation.box(
        [size_m] * 3, trimesh.transformations.translation_matrix([0.3, 0, 0])
    )
    return trimesh.util.concatenate([mesh, box])


@pytest.mark.parametrize("wall_m", [WALL_M, 0.0])
@pytest.mark.parametrize("change", [lambda mesh: mesh, flipped, beside])
def test_a_cup_has_its_volume_and_wall_however_it_is_wound(wall_m, change, tmp_path):
    change(cup(wall_m)).export(tmp_path / "cup.obj")
    target = load_target(tmp_path / "cup.obj")
    mug = ObjectModel.learn(load_object(find_object("mug")))
    warped = warp_object(mug, target.cloud)
    assert pouring_parameters(warped, None).volume_m3 == pytest.approx(VOLUME_M3, rel=0.03)
    assert not (warped.labels == Part.HANDLE).any()
    assert target.wall_m == pytest.approx(wall_m, abs=2e-4)


def test_a_body_without_a_cavity_is_still_closed(tmp_path):
    trimesh.creation.cylinder(RADIUS_M, DEPTH_M).export(tmp_path / "solid.obj")
    with pytest.raises(ArgumentError, match="closed on top"):
        load_target(tmp_path / "solid.obj")
    beside(cup(WALL_M), 0.06).export(tmp_path / "two.obj")
    with pytest.raises(ArgumentError, match="expected one object, got 1 beside it"):
        load_target(tmp_path / "two.obj")


def test_vertices_that_are_nan_are_named_not_left_out(tmp_path):
    cup(WALL_M).export(tmp_path / "cup.obj")
    text = (tmp_path / "cup.obj").read_text()
    (tmp_path / "cup.obj").write_text(text.replace("v 0.03700000 ", "v nan ", 1))
    with pytest.raises(ArgumentError, match="vertices: expected finite ones, got 1 with NaN"):
        load_target(tmp_path / "cup.obj")

# SPDX-License-Identifier: Apache-2.0
"""Volumes below a plane, against shapes whose answer is known."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.warping.clipping import half_volume_angle, shares_left, surface_volume

UP, OUT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def volume_below(mesh, point, up):
    """What an untilted container with its lip at the point holds."""
    (share,) = shares_left(mesh.vertices, mesh.faces, point, up, np.zeros(3), np.zeros(1))
    return share * surface_volume(mesh.vertices, mesh.faces)


@settings(max_examples=40, deadline=None)
@given(level=st.floats(-0.6, 0.6), seed=st.integers(0, 999))
def test_both_sides_of_a_plane_are_the_whole(level, seed):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)
    point = level * normal + np.cross(normal, [0.3, 0.1, 0.2])
    below, above = (volume_below(ball, point, up) for up in (normal, -normal))
    assert below + above == pytest.approx(surface_volume(ball.vertices, ball.faces), rel=1e-9)
    height = np.clip(level + 0.5, 0.0, 1.0)
    cap = np.pi * height**2 * (1.5 - height) / 3.0
    assert below == pytest.approx(cap, abs=0.03)


@pytest.mark.parametrize("height", [0.5, 2.0, 6.0])
def test_half_of_a_box_is_left_at_its_diagonal(height):
    """tan(angle) = height / width about the edge's middle."""
    box = trimesh.creation.box((2.0, 2.0, height))
    lip = np.array([1.0, 0.0, height / 2.0])
    angle = half_volume_angle(box.vertices, box.faces, lip, UP, OUT)
    assert np.tan(angle) == pytest.approx(height / 2.0, rel=1e-4)


def test_a_surface_turned_inside_out_is_refused():
    box = trimesh.creation.box((1.0, 1.0, 1.0))
    with pytest.raises(ArgumentError, match="Wind the faces outward"):
        half_volume_angle(box.vertices, box.faces[:, ::-1], np.array([0.5, 0, 0.5]), UP, OUT)

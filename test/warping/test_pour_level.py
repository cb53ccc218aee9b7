# SPDX-License-Identifier: Apache-2.0
"""Volumes below a plane, and pouring to a level, against shapes whose answer is known."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from intent_recognition.errors import ArgumentError
from intent_recognition.warping.clipping import half_volume_angle, shares_left, surface_volume
from intent_recognition.warping.pour_level import (
    Reached,
    amount_to_leave,
    emptying,
    tilts_to_level,
)

UP, OUT = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
BOX = trimesh.creation.box((2.0, 2.0, 2.0))
LIP = np.array([1.0, 0.0, 1.0])
WARPED = SimpleNamespace(rim=SimpleNamespace(up=UP, outward=lambda lip: OUT), cavity=BOX)


def left_in_box(tilt, above=0.0):
    surface = (BOX.vertices, BOX.faces, LIP, UP, OUT)
    return shares_left(*surface, np.atleast_1d(tilt), above)


def test_a_box_holds_a_wedge():
    """Above 45 degrees a triangle of legs 2 and 2 / tan(tilt), below it all but one."""
    steep = np.deg2rad([50.0, 65.0, 80.0])
    np.testing.assert_allclose(left_in_box(steep), 0.5 / np.tan(steep))
    np.testing.assert_allclose(left_in_box(np.pi / 2 - steep), 1.0 - 0.5 / np.tan(steep))
    half = half_volume_angle(BOX.vertices, BOX.faces, LIP, UP, OUT)
    assert left_in_box(half)[0] == pytest.approx(0.5, abs=1e-5)


def test_what_stands_above_the_lip_stays_longer():
    """Level, raised by a quarter of the height: nothing above the rim counts; tilted, a slab."""
    assert left_in_box(0.0, 0.5)[0] == pytest.approx(1.0)
    tilt = np.deg2rad(60.0)
    legs = 2.0 / np.tan(tilt) + 0.5 / np.sin(tilt)
    floor = 2.0 + 0.5 / np.cos(tilt)  # where the raised plane would meet the lip's wall
    raised = 0.5 * legs * legs * np.tan(tilt) - 0.5 * (floor - 2.0) ** 2 / np.tan(tilt)
    assert left_in_box(tilt, 0.5)[0] == pytest.approx(raised / 4.0)
    assert emptying(WARPED, LIP, 0.5).tilt_leaving(raised / 4.0) == pytest.approx(tilt)
    assert left_in_box(emptying(WARPED, LIP, 0.5).empty_rad)[0] == pytest.approx(0.01, abs=1e-3)


def test_the_tilt_that_leaves_a_share_leaves_it():
    cup = emptying(WARPED, LIP)
    for share in (0.9, 0.5, 0.2, 0.05):
        assert left_in_box(cup.tilt_leaving(share))[0] == pytest.approx(share, abs=2e-3)


def test_what_is_asked_for_stays_out_of_the_cup():
    assert amount_to_leave("empty", 2e-4, 1e-4) == 0.0
    assert amount_to_leave("full", 2e-4, 1e-4) == pytest.approx(1.1e-4)
    assert amount_to_leave("full", 2e-4, 1e-3) == 0.0
    assert amount_to_leave("50", 2e-4, 1e-4) == pytest.approx(1.5e-4)
    for asked in ("half", 0, -3, 150, "nan", "300"):
        with pytest.raises(ArgumentError, match="up to 100 millilitres"):
            amount_to_leave(asked, 2e-4, 1e-4)


def test_a_pour_to_where_it_was_demonstrated_is_the_demonstrated_one():
    """The same container, half full and emptied: ratios times their reference."""
    cup, reference = emptying(WARPED, LIP), np.deg2rad(45.0)
    ratios = np.concatenate([np.linspace(0.0, 2.6, 30), np.linspace(2.6, 0.1, 20)])
    far = Reached(1.0, 2.6, 2.6 * reference - cup.empty_rad)
    tilts = tilts_to_level(ratios, far, cup, 0.5, 0.0)
    np.testing.assert_allclose(tilts, ratios * reference, atol=1e-3)


def test_a_pour_ends_where_what_is_left_is_level_with_the_lip():
    cup, ratios = emptying(WARPED, LIP), np.linspace(0.0, 2.6, 400)
    far = Reached(1.0, 2.6, 0.9)
    for left in (0.4, 0.1):
        tilts = tilts_to_level(ratios, far, cup, 0.5, left)
        assert tilts[-1] == pytest.approx(cup.tilt_leaving(left))
        assert np.all(np.diff(tilts) > 0.0)
        assert np.abs(np.diff(tilts, 2)).max() < 1e-3  # no kink where it begins to pour
        assert tilts[np.searchsorted(ratios, 1.0)] == pytest.approx(cup.tilt_leaving(0.5), abs=0.01)


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

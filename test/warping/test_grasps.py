# SPDX-License-Identifier: Apache-2.0
"""Identities of warped grasps, and where they are on containers whose wall is known."""

from dataclasses import replace

import numpy as np
import pytest
from scan_builder import scanned
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.warping import (
    Grasp,
    ObjectCloud,
    ObjectModel,
    Part,
    warp_grasp,
    warp_object,
)
from intent_recognition.warping.grasp_warp import contact_rows
from sim_bridge.containers.generate import CONTAINER_NAMES, make_container

TURN = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()
SHIFT = np.array([0.4, -0.2, 1.0])
MAPPINGS = ["label", "point"]


def moved(cloud, scale=1.0, turn=TURN, shift=SHIFT):
    return ObjectCloud(scale * cloud.points @ turn.T + shift, cloud.normals @ turn.T)


def assert_moved(after, before, scale=1.0, turn=TURN, shift=SHIFT):
    np.testing.assert_allclose(after.pose[:3, :3], turn @ before.pose[:3, :3], atol=1e-9)
    np.testing.assert_allclose(after.centre, scale * turn @ before.centre + shift, atol=1e-9)
    assert after.width_m == pytest.approx(scale * before.width_m, rel=1e-9)


@pytest.fixture(scope="module")
def across(mug):
    """The mug with a grasp across its body, whose pads both touch the outer wall."""
    radius = 0.5 * np.ptp(mug.annotated.points[:, 1])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]])
    pose[:3, 3] = [0.0, 0.0, 0.06]
    return ObjectModel.learn(replace(mug.annotated, grasp=Grasp(pose, 2.0 * radius)))


@pytest.mark.parametrize("mapping", MAPPINGS)
@pytest.mark.parametrize("scale", [1.0, 0.6, 1.7])
def test_a_scaled_and_moved_source_scales_and_moves_the_grasp(mug, across, mapping, scale):
    """Also a grasp that is not at the wall's middle; at scale 1 in place it is the same."""
    for source in (mug, across):
        target = moved(source.annotated, scale)
        found = warp_grasp(source, warp_object(source, target, mapping))
        assert_moved(found, source.annotated.grasp, scale)
        own = warp_grasp(source, warp_object(source, moved(source.annotated, 1.0, np.eye(3), 0.0)))
        assert_moved(own, source.annotated.grasp, 1.0, np.eye(3), np.zeros(3))


@pytest.mark.parametrize("name", ["tea_cup", "square_bowl"])
def test_motion_and_size_of_the_target_are_those_of_the_grasp(mug, name):
    cloud = scanned(name)
    first = warp_grasp(mug, warp_object(mug, cloud))
    for size in (1.0, 1.5):
        assert_moved(warp_grasp(mug, warp_object(mug, moved(cloud, size))), first, size)


@pytest.mark.slow
@pytest.mark.parametrize("n_views", [1, 2, 3])
def test_the_warped_grasp_is_on_the_wall(mug, n_views):
    """Its middle is in or beside the wall, across it, below the crest; also where one side of the
    wall was not seen."""
    errors = []
    for name in CONTAINER_NAMES[1:]:
        container, cloud = make_container(name, 1), scanned(name, 1, n_views)
        warped = warp_object(mug, cloud)
        grasp = warp_grasp(mug, warped)
        errors.append(abs(_outside_m(container, grasp.centre)))
        below = container.height_m - grasp.centre[2]
        assert 0.003 < below < 0.25 * container.height_m
        assert grasp.approach[2] < -0.8
        assert grasp.closing[:2] @ grasp.centre[:2] > 0.8 * np.linalg.norm(grasp.centre[:2])
    assert max(errors) < 0.004
    assert np.median(errors) < 0.0015


def _outside_m(container, point):
    """How far a point (3,) is from the middle of the wall, along the radius [m]."""
    sections = container.sections
    middles = np.linalg.norm(0.5 * (sections.inner + sections.outer), axis=2)
    turn = np.arctan2(point[1], point[0]) / (2.0 * np.pi) * middles.shape[1]
    corners = np.arange(middles.shape[1])
    ring = [np.interp(turn, corners, one, period=len(corners)) for one in middles]
    return np.hypot(*point[:2]) - np.interp(point[2], sections.heights_m, ring)


def test_a_grasp_across_the_body_widens_with_it(across):
    """Its width is the diameter there."""
    for name in ("tall_mug", "espresso_cup", "tumbler"):
        container = make_container(name, 1)
        found = warp_grasp(across, warp_object(across, scanned(name, 1, 3)))
        sections = container.sections
        radii = np.linalg.norm(sections.outer, axis=2).mean(1)
        wide = 2.0 * np.interp(found.centre[2], sections.heights_m, radii)
        assert found.width_m == pytest.approx(wide, rel=0.04)
        assert np.linalg.norm(found.centre[:2]) < 0.003


@pytest.mark.parametrize("share", [0.5, 0.95])
def test_a_thinner_wall_narrows_the_grasp_down_to_a_fifth(mug, share):
    """The fifth is of the width that the target's size alone would give."""
    own, good = mug.annotated, mug.annotated.grasp
    sides = [own.points[rows].mean(axis=0) for rows in contact_rows(own, good)]
    thickness = (sides[0] - sides[1]) @ good.closing
    thin = ObjectCloud(own.points - 0.5 * share * thickness * own.normals, own.normals)
    warped = warp_object(mug, thin, "point")
    wide = warped.frame.radius_m / mug.frame.radius_m
    least = max(1.0 - share, 0.2 * wide)
    assert warp_grasp(mug, warped).width_m == pytest.approx(least * good.width_m, rel=0.02)


def test_what_cannot_be_grasped_is_said(mug):
    own, good = mug.annotated, mug.annotated.grasp
    cloud = scanned("tumbler")
    far = good.pose.copy()
    far[:3, 3] += 0.1
    aside = ObjectModel(replace(own, grasp=Grasp(far, 0.01)), mug.classifier, mug.frame)
    with pytest.raises(ArgumentError, match="under each pad"):
        warp_grasp(aside, warp_object(aside, cloud))
    handle = own.points[own.labels == Part.HANDLE]
    grip = handle[np.argmin(handle[:, 0])]
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    pose[:3, 3] = [grip[0] + 0.004, 0.0, grip[2]]
    held = ObjectModel(replace(own, grasp=Grasp(pose, 0.009)), mug.classifier, mug.frame)
    with pytest.raises(ArgumentError, match="a target with a handle"):
        warp_grasp(held, warp_object(held, cloud))
    mirrored = good.pose.copy()
    mirrored[:3, 0] *= -1.0
    for bad, reason in ((2.0 * good.pose, "rigid"), (mirrored, "right-handed")):
        with pytest.raises(ArgumentError, match=reason):
            Grasp(bad, 0.01)
    with pytest.raises(ShapeError):
        Grasp(np.eye(3), 0.01)
    for width in (0.0, np.nan):
        with pytest.raises(ArgumentError, match="width_m"):
            Grasp(good.pose, width)

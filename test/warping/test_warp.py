# SPDX-License-Identifier: Apache-2.0
"""Identities of warping, and its accuracy on containers whose truth is known."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scan_builder import scanned
from scipy.spatial.transform import Rotation

from experiments.annotate import labels_of
from intent_recognition.errors import ArgumentError
from intent_recognition.warping import ObjectCloud, Part, pouring_parameters, warp_object
from intent_recognition.warping.cavity import (
    FLOOR_TO_WALL,
    _levels,
    _profile,
    _thickness,
    fit_cavity,
)
from intent_recognition.warping.frame import N_LEVELS, ObjectFrame
from intent_recognition.warping.opening import _bearing, _looks_into
from intent_recognition.warping.pour_level import LEFT_WHEN_EMPTY, emptying
from intent_recognition.warping.rim import N_HARMONICS, Rim, _crest_level, _fit_harmonics
from sim_bridge.containers.generate import CONTAINER_NAMES, make_container

names = st.sampled_from(CONTAINER_NAMES)
seeds = st.integers(0, 3)
UP = np.array([0.0, 0.0, 1.0])
random_examples = settings(
    max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def numbers(parameters) -> np.ndarray:
    """Radius, cube root of the volume, height and tilt."""
    return np.array(
        [
            parameters.opening_radius_m,
            parameters.volume_m3 ** (1.0 / 3.0),
            parameters.height_m,
            parameters.tilt_reference_rad,
        ]
    )


@pytest.mark.parametrize("mapping", ["label", "point"])
@pytest.mark.parametrize("k", [1, 3])
def test_warping_an_object_onto_itself_changes_nothing(mug, mapping, k):
    """With one neighbour neither points nor labels change; with more hardly a label does."""
    own = mug.annotated
    warped = warp_object(mug, ObjectCloud(own.points, own.normals), mapping, k)
    if k == 1:
        np.testing.assert_array_equal(warped.points, own.points)
        np.testing.assert_allclose(warped.normals, own.normals, atol=1e-14)
        np.testing.assert_array_equal(warped.labels, own.labels)
    assert (warped.labels == own.labels).mean() > 0.93
    assert np.abs(warped.points - own.points).max() < 0.02


@pytest.mark.slow
@random_examples
@given(name=names, seed=seeds, scale=st.floats(0.4, 4.0))
def test_lengths_scale_and_angles_do_not(mug, name, seed, scale):
    cloud = scanned(name, seed)
    larger = ObjectCloud(scale * cloud.points, cloud.normals)
    first, second = (pouring_parameters(warp_object(mug, one)) for one in (cloud, larger))
    expected = numbers(first) * [scale, scale, scale, 1.0]
    np.testing.assert_allclose(numbers(second), expected, rtol=1e-6)
    np.testing.assert_allclose(second.opening_centre, scale * first.opening_centre, atol=1e-7)
    np.testing.assert_allclose(second.lip_point, scale * first.lip_point, atol=1e-7)


@pytest.mark.slow
@random_examples
@given(
    name=names,
    seed=seeds,
    turn=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    shift=st.tuples(*[st.floats(-2.0, 2.0)] * 3),
    mapping=st.sampled_from(["label", "point"]),
)
def test_rigid_motion_changes_no_parameter(mug, name, seed, turn, shift, mapping):
    cloud = scanned(name, seed)
    rotation = Rotation.from_rotvec(turn).as_matrix()
    moved = ObjectCloud(cloud.points @ rotation.T + shift, cloud.normals @ rotation.T)
    first, second = (pouring_parameters(warp_object(mug, one, mapping)) for one in (cloud, moved))
    np.testing.assert_allclose(numbers(second), numbers(first), rtol=1e-6)
    for before, after in (
        (first.opening_centre, second.opening_centre),
        (first.lip_point, second.lip_point),
    ):
        np.testing.assert_allclose(after, rotation @ before + shift, atol=1e-7)
    first, second = (_bearing(one.points, up) for one, up in ((cloud, UP), (moved, rotation @ UP)))
    np.testing.assert_allclose(second.centre, rotation @ first.centre + shift, atol=1e-7)


@random_examples
@given(
    name=names,
    seed=st.integers(4, 30),
    n_views=st.integers(1, 3),
    mapping=st.sampled_from(["label", "point"]),
)
def test_parameters_are_near_the_truth(mug, name, seed, n_views, mapping):
    """Random containers, one to three views: the bounds that hold for every one."""
    container = make_container(name, seed)
    other = np.array([0.4, 0.1, 0.0])
    found = pouring_parameters(warp_object(mug, scanned(name, seed, n_views), mapping), other)
    assert found.opening_radius_m == pytest.approx(container.opening_radius_m, rel=0.03)
    assert found.volume_m3 == pytest.approx(container.inner_volume_m3, rel=0.10)
    assert found.height_m == pytest.approx(container.height_m, rel=0.10)
    truth = container.tilt_reference_about(container.lip_toward(other))
    assert found.tilt_reference_rad == pytest.approx(truth, abs=np.radians(4.0))
    assert np.linalg.norm(found.opening_centre - container.opening_centre) < 0.004


def test_labels_are_those_of_the_parts(mug):
    for name in ("tall_mug", "tea_cup", "tumbler", "square_bowl"):
        container, cloud = make_container(name, 1), scanned(name)
        warped = warp_object(mug, cloud)
        truth = labels_of(container, cloud.points)
        assert (warped.labels == truth).mean() > 0.88
        assert (len(warped.part(Part.HANDLE)) > 0) == (container.handle is not None)


@pytest.mark.parametrize(("name", "seed"), [("tall_mug", 104), ("espresso_cup", 104)])
def test_no_point_of_the_wall_is_drawn_to_the_handle(mug, name, seed):
    """In one view half of the wall has no counterpart; the handle's inside faces the same way."""
    container, cloud = make_container(name, seed), scanned(name, seed, 1)
    warped = warp_object(mug, cloud, "point")
    body = warped.points[warped.labels != Part.HANDLE]
    outside = -body[:, 0] > 1.3 * container.opening_radius_m
    assert (cloud.points[:, 0] < -1.3 * container.opening_radius_m).any()
    assert not outside.any()
    error = pouring_parameters(warped).volume_m3 / container.inner_volume_m3 - 1.0
    assert abs(error) < 0.06


def test_lip_follows_the_other_container_or_the_handle(mug):
    """Closest to the other one; else opposite to the handle."""
    warped = warp_object(mug, scanned("tall_mug"))
    centre, radius = warped.rim.centre, warped.rim.radius_m
    near = pouring_parameters(warped, toward=centre + [0.0, 0.5, -0.1])
    assert near.lip_point == pytest.approx(centre + [0.0, radius, 0.0], abs=0.004)
    crest = warped.rim.crest
    rim = crest + np.linspace(0.0, 1.0, 100)[:, None, None] * (np.roll(crest, -1, axis=0) - crest)
    for angle in range(7):
        beside = centre + 1.2 * radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        at = np.argmin(np.linalg.norm(rim.reshape(-1, 3) - beside, axis=1))
        assert pouring_parameters(warped, beside).lip_point == pytest.approx(
            rim.reshape(-1, 3)[at], abs=1e-4
        )
    level = pouring_parameters(warped)
    assert level.lip_point[0] > centre[0] + 0.9 * radius
    assert near.tilt_reference_rad == pytest.approx(level.tilt_reference_rad, abs=0.02)


def test_the_crest_of_a_round_rim_is_where_its_normal_points_up(rng):
    upward = rng.uniform(0.3, 1.0, size=200)
    level = 0.1 - 0.005 * (1.0 - upward) + 1e-4 * rng.normal(size=200)
    assert _crest_level(level, upward) == pytest.approx(0.1, abs=1e-4)


def test_at_the_reference_tilt_half_of_the_volume_is_below_the_lip(mug):
    """Cut by trimesh; with the lip as apex, the cut itself spans no tetrahedra."""
    warped = warp_object(mug, scanned("tea_cup"))
    found, rim = pouring_parameters(warped), warped.rim
    lip, tilt = found.lip_point, found.tilt_reference_rad
    vertical = np.cos(tilt) * rim.up - np.sin(tilt) * rim.outward(lip)
    cavity = trimesh.Trimesh(warped.cavity.vertices, warped.cavity.faces, process=False)
    below = cavity.slice_plane(lip, -vertical)
    volume = np.linalg.det(below.triangles - lip).sum() / 6.0
    assert volume == pytest.approx(0.5 * found.volume_m3, rel=1e-6)
    holds, heaped = (emptying(warped, lip, above_m) for above_m in (0.0, 0.01))
    assert holds.tilt_leaving(0.5) == pytest.approx(tilt, abs=0.01)
    assert holds.tilt_leaving(LEFT_WHEN_EMPTY) == pytest.approx(holds.empty_rad)
    assert np.all(heaped.shares > holds.shares - 1e-9) and heaped.empty_rad == holds.empty_rad


def test_a_wall_is_measured_level_by_level():
    """That of a cone, of which one side was not seen."""
    depth = (np.arange(4000) + 0.5) / 4000 * 0.1
    found = _levels(depth, 0.03 + 0.2 * depth, np.arange(4000) % 2 == 0, 0.1)
    middles = (np.arange(N_LEVELS) + 0.5) / N_LEVELS * 0.1
    np.testing.assert_allclose(found, np.stack([middles, 0.03 + 0.2 * middles], 1), atol=1e-4)


def test_a_wall_is_as_thick_as_it_may_be():
    depth = np.linspace(0.0, 0.1, 30)
    for gap, expected in ((-0.02, 0.01), (0.004, 0.1), (0.02, 0.3)):
        inner, outer = np.full((30, 2), 0.03), np.full((30, 2), 0.03 + gap)
        inner[:, 1] = outer[:, 0] = depth
        found = _thickness(inner, outer, SimpleNamespace(radius_m=0.04))
        assert found == pytest.approx(expected * 0.04)


def test_where_the_floor_is_not_seen_the_cavity_follows_the_wall_outside():
    """A cone, its inside seen to half of the depth, with a wall of 3 mm."""
    rim, depth = SimpleNamespace(radius_m=0.04, depth_m=0.1), np.linspace(0.004, 0.1, 25)
    inside = 0.04 - 0.1 * depth
    inner, outer = np.stack([inside, depth], 1)[:12], np.stack([depth, inside + 0.003], 1)
    found, height = _profile(inner, outer, None, True, rim)
    floor_m = 0.1 - FLOOR_TO_WALL * 0.003
    assert height == 0.1 and np.all(np.diff(found[:-1, 1]) > 0.0)
    np.testing.assert_allclose(found[:-2, 0], 0.04 - 0.1 * found[:-2, 1], atol=2e-5)
    assert len(found) == 3 + np.sum(depth < floor_m)
    np.testing.assert_allclose(found[-2:], [[found[-3, 0], floor_m], [0.0, floor_m]], atol=1e-4)
    found, height = _profile(inner, outer, 0.099, False, rim)
    assert height == pytest.approx(0.099 + FLOOR_TO_WALL * 0.003, abs=1e-4)
    np.testing.assert_array_equal(found, [[0.04, 0.0], *inner, [0.0, 0.099]])


@pytest.mark.parametrize("base_seen", [True, False])
def test_a_base_that_is_not_seen_is_below_the_floor(base_seen):
    """A beaker with a wall of 3 mm, whose floor is as deep as its wall was seen."""
    turns, depth = (part.ravel() for part in np.mgrid[0:6.28:60j, 0.001:0.1:60j])
    around, flat = np.stack([0.0 * turns, np.cos(turns), np.sin(turns)], 1), 0.3 * depth
    down, disc = depth[:, None] * [-1.0, 0.0, 0.0], np.array([-0.1, 0.0, 0.0])
    sides = [(0.03 * around + down, -around), (0.033 * around + down, around)]
    sides.append((flat[:, None] * around + disc, np.tile([1.0, 0.0, 0.0], (3600, 1))))
    if base_seen:
        base = 1.1 * flat[:, None] * around + 1.04 * disc
        sides.append((base, np.tile([-1.0, 0.0, 0.0], (3600, 1))))
    corners = np.arange(48) * 2.0 * np.pi / 48
    outline = 0.03 * np.stack([np.cos(corners), np.sin(corners)], 1)
    rim = Rim(np.zeros(3), np.eye(3), outline, 0.104 if base_seen else 0.1)
    found = fit_cavity(*map(np.concatenate, zip(*sides, strict=True)), rim)
    expected = 0.104 if base_seen else 0.1 + FLOOR_TO_WALL * 0.003
    assert found.height_m == pytest.approx(expected, abs=3e-4)


def test_the_radius_of_a_rim_does_not_depend_on_how_densely_it_is_seen():
    even = np.linspace(0.0, 2.0 * np.pi, 4000, endpoint=False)
    found = []
    for turns in (even, even + 0.8 * np.sin(even)):
        outline = np.stack([0.03 * np.cos(turns), 0.05 * np.sin(turns)], axis=1)
        found.append(Rim(np.zeros(3), np.eye(3), outline, 0.1).radius_m)
    assert found[1] == pytest.approx(found[0], rel=1e-4)


def test_the_outline_of_a_rim_is_smooth_and_its_centre_and_thickness_are_free():
    rng, orders = np.random.default_rng(3), np.arange(1, N_HARMONICS + 1)
    angles, outward = rng.uniform(-np.pi, np.pi, 60), rng.uniform(-1.0, 1.0, 60)
    radii = 0.04 + 0.01 * rng.normal(size=60)
    turns = np.exp(1j * np.outer(angles, orders))
    design = np.column_stack([np.ones(60), turns.real, turns.imag, outward])
    weight = np.where(orders == 1, 0.0, np.sqrt(0.02) * orders)
    penalty = np.diag([0.0, *weight, *weight, 0.0])
    expected = np.linalg.lstsq(
        np.vstack([design, penalty]), np.r_[radii, np.zeros(len(penalty))], rcond=None
    )[0]
    np.testing.assert_allclose(_fit_harmonics(angles, radii, outward), expected, rtol=1e-6)


def test_an_opening_looks_into_what_faces_it():
    turns = np.linspace(0.0, 6.0, 50)
    outward = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
    opening = SimpleNamespace(centre=np.zeros(3), up=UP, radius_m=0.031)
    for facing, share in ((-1.0, 1.0), (1.0, 0.0)):
        wall = 0.03 * outward - 0.05 * UP, facing * outward
        assert _looks_into(*wall, opening, 0.001) == share
    # Of 10 points six face it; one lies on it, one above, and two are a base seen from below.
    aside = np.repeat([0.03, 0.01, 0.03, 0.01], [6, 1, 1, 2])
    level = np.repeat([-0.05, 0.0, 0.05, -0.05], [6, 1, 1, 2])
    points = aside[:, None] * outward[:10] + level[:, None] * UP
    normals = np.concatenate([-outward[:6], [UP, UP, -UP, -UP]])
    assert _looks_into(points, normals, opening, 0.001) == pytest.approx(0.6 - 0.3 - 0.3 - 0.2)


def test_a_handle_is_what_stands_out_of_the_wall_at_its_level_on_its_side():
    frame = ObjectFrame(np.zeros(3), np.eye(3), 0.03, 0.1, 0.05, np.linspace(0.8, 1.6, N_LEVELS))
    local = [[-0.095, 0.035, 0.0], [-0.095, -0.035, 0.0], [-0.005, 0.035, 0.0]]
    assert frame.on_handle(np.array(local)).tolist() == [True, False, False]


def test_unknown_mapping_and_k_are_refused(mug):
    with pytest.raises(ArgumentError, match="mapping"):
        warp_object(mug, scanned("tumbler"), "both")
    with pytest.raises(ArgumentError, match="k"):
        warp_object(mug, scanned("tumbler"), k=0)

# SPDX-License-Identifier: Apache-2.0
"""Ten containers, what is said to be true of them, and what depth cameras measure of them."""

import numpy as np
import pytest
import trimesh
from scipy.integrate import trapezoid

from benchmarks.measured_mesh import measure_mesh
from experiments.annotate import annotated, labels_of
from intent_recognition.errors import ArgumentError
from intent_recognition.objects.file import find_object, load_object
from intent_recognition.warping.object_model import Part
from sim_bridge.containers import CONTAINER_NAMES, Camera, make_container, scan
from sim_bridge.containers.generate import ContainerShape, build_container

SEEDS = (0, 1, 2)
HANDLED = ("mug", "tall_mug", "espresso_cup", "tea_cup")


@pytest.mark.parametrize("name", CONTAINER_NAMES)
def test_solids_are_closed_and_wound_outward(name):
    for seed in SEEDS:
        container = make_container(name, seed)
        solids = [container.mesh, container.inner]
        solids += [] if container.handle is None else [container.handle]
        for solid in solids:
            assert solid.is_watertight
            assert solid.is_winding_consistent
            assert solid.volume > 0.0
        assert container.inner.volume == pytest.approx(container.inner_volume_m3)
        assert container.mesh.bounds[:, 2] == pytest.approx([0.0, container.height_m])
        assert (container.handle is not None) == (name in HANDLED)


@pytest.mark.parametrize("name", CONTAINER_NAMES)
def test_sections_are_the_wall(name):
    """The pieces between the rings and the floor fill the solid without its handle."""
    container = make_container(name, 1)
    rings, outer = container.sections, container.sections.outer
    assert (np.diff(rings.heights_m) > 0.0).all()
    np.testing.assert_allclose(rings.inner[-1], outer[-1])
    assert (np.linalg.norm(rings.inner, axis=2) <= np.linalg.norm(outer, axis=2) + 1e-12).all()
    handle = 0.0 if container.handle is None else container.handle.volume
    areas = [_area(o) - _area(i) for o, i in zip(outer, rings.inner, strict=True)]
    walls = trapezoid(areas, rings.heights_m)
    floor = trapezoid([_area(rings.base), _area(outer[0])], [0.0, rings.heights_m[0]])
    assert container.mesh.volume - handle == pytest.approx(walls + floor, rel=0.01)


def test_a_cylinder_has_the_tilt_of_its_diagonal_and_a_lip_toward_the_other():
    """Half of a cylinder is left when its diagonal is level: tan(angle) = height / diameter."""
    cup = build_container("can", ContainerShape(0.1, 0.03, 0.03, 1e-5, 1e-5))
    assert np.tan(cup.tilt_reference_rad) == pytest.approx(0.1 / 0.06, rel=2e-3)
    assert cup.inner_volume_m3 == pytest.approx(np.pi * 0.03**2 * 0.1, rel=3e-3)
    assert cup.opening_radius_m == pytest.approx(0.03, rel=1e-3)
    tumbler, square = make_container("tumbler"), make_container("square_bowl")
    lip = tumbler.lip_toward(np.array([0.3, 0.3, -0.2]))
    np.testing.assert_allclose(
        lip, [*[tumbler.opening_radius_m / np.sqrt(2)] * 2, tumbler.height_m], 1e-2
    )
    side = square.lip_toward(np.array([0.0, -0.4, 0.0]))
    assert abs(side[0]) < 0.002
    assert -side[1] < square.opening_radius_m


def test_tilt_of_the_mesh_cut_by_a_plane_and_labels_of_its_parts():
    """Trimesh's own cut of the cavity at the reference tilt leaves half of it."""
    for name in CONTAINER_NAMES:
        container = make_container(name, 2)
        angle = container.tilt_reference_rad
        above = np.array([np.sin(angle), 0.0, -np.cos(angle)])
        left = container.inner.slice_plane(container.lip_point, above)
        # The lid of the cut lies in the plane of the lip: take that as origin.
        left.apply_translation(-container.lip_point)
        volume = np.einsum(
            "ij,ij->i", left.triangles[:, 0], np.cross(left.triangles[:, 1], left.triangles[:, 2])
        )
        assert volume.sum() / 6.0 == pytest.approx(0.5 * container.inner_volume_m3, rel=1e-3)
    for name in CONTAINER_NAMES:
        container = make_container(name, 0)
        points = trimesh.sample.sample_surface(container.mesh, 3000, seed=1)[0]
        labels = labels_of(container, points)
        rim, handle = points[labels == Part.RIM], points[labels == Part.HANDLE]
        assert rim[:, 2].min() > container.height_m - 0.003
        assert (len(handle) > 0) == (name in HANDLED)
        if len(handle):
            assert np.linalg.norm(handle[:, :2], axis=1).min() > 0.5 * container.opening_radius_m


def _area(outline: np.ndarray) -> float:
    """Area of a closed outline (S, 2)."""
    following = np.roll(outline, -1, axis=0)
    return 0.5 * float((outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]).sum())


EXACT = Camera(depth_noise_std_m=0.0, normal_noise_std_rad=0.0)


@pytest.mark.parametrize("name", ["mug", "shallow_bowl", "square_bowl"])
def test_points_are_on_the_surface_and_are_seen(name):
    container = make_container(name)
    seen = scan(container.mesh, np.random.default_rng(0), 2, 500, EXACT)
    _, distance, _ = trimesh.proximity.closest_point_naive(container.mesh, seen.points[:60])
    assert distance.max() < 1e-6
    rays = seen.viewpoints - seen.points
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    assert ((rays * seen.normals).sum(1) > 0.1).all()
    start = seen.points + 1e-5 * rays
    assert not container.mesh.ray.intersects_any(start, rays).any()


def test_noise_is_along_the_ray_and_as_large_as_said_and_points_as_many_as_are_seen():
    container = make_container("tumbler")
    exact = scan(container.mesh, np.random.default_rng(3), 1, 1500, EXACT)
    noisy = scan(container.mesh, np.random.default_rng(3), 1, 1500)
    offsets = noisy.points - exact.points
    rays = exact.points - exact.viewpoints
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    along = (offsets * rays).sum(1)
    np.testing.assert_allclose(offsets, along[:, None] * rays, atol=1e-9)
    assert along.std() == pytest.approx(0.0007, rel=0.1)
    far = Camera(distance_m=0.7, grazing_rad=1.5)
    with pytest.raises(ArgumentError, match="n_points"):
        scan(make_container("tall_glass").mesh, np.random.default_rng(0), 1, 2000, far)


@pytest.mark.parametrize("name", [CONTAINER_NAMES[0], "tea_cup", "square_bowl"])
def test_free_space_is_the_cavity(name):
    """Counting cubes of free space gives volume, opening, height and tilt of the truth."""
    container = make_container(name, 1)
    measured = measure_mesh(container.mesh)
    other = np.array([0.4, 0.1, 0.0])
    assert measured.volume_m3 == pytest.approx(container.inner_volume_m3, rel=0.01)
    assert measured.opening_radius_m == pytest.approx(container.opening_radius_m, rel=0.01)
    assert measured.height_m == pytest.approx(container.height_m, rel=1e-3)
    found = measured.tilt_reference_about(measured.lip_toward(other))
    truth = container.tilt_reference_about(container.lip_toward(other))
    assert found == pytest.approx(truth, abs=np.radians(0.5))


def test_the_shipped_mug_is_the_annotated_mug():
    """The file can be made again."""
    shipped, made = load_object(find_object("mug")), annotated()
    np.testing.assert_allclose(shipped.points, made.points, atol=1e-6)
    np.testing.assert_array_equal(shipped.labels, made.labels)
    assert shipped.name == "mug"

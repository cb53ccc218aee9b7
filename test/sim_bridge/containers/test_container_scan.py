# SPDX-License-Identifier: Apache-2.0
"""Depth cameras and free space: what is measured of the containers agrees with their truth."""

import numpy as np
import pytest
import trimesh

from benchmarks.measured_mesh import measure_mesh
from experiments.annotate import annotated
from intent_recognition.errors import ArgumentError
from intent_recognition.objects.file import find_object, load_object
from sim_bridge.containers import CONTAINER_NAMES, Camera, make_container, scan

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

# SPDX-License-Identifier: Apache-2.0
"""
Warping a cup
=============

The points of one mug are annotated as rim, container or handle. Warping transfers the annotation to
another container of any size, place and orientation (Brandl et al. 2014, II). Its parts give the
numbers that pouring needs: opening, volume, lip, tilt angle (:doc:`../warping`).
"""

import matplotlib.pyplot as plt
import numpy as np

import intent_recognition as ir

mug = ir.ObjectModel.learn(ir.load_object(ir.find_object("mug")))

# %%
# The other container is a conical bowl, made of points with outward normals, as a depth camera
# would give. It has no handle, and stands tilted in the room.

HEIGHT_M, BASE_RADIUS_M, TOP_RADIUS_M, WALL_M = 0.09, 0.045, 0.075, 0.004
rng = np.random.default_rng(1)


def cone(n, radius_base, radius_top, low, high, outward):
    """Points (n, 3) on a cone about z, and normals: away from the axis if `outward`."""
    share, angle = rng.uniform(size=n), rng.uniform(0.0, 2.0 * np.pi, n)
    radius = radius_base + share * (radius_top - radius_base)
    around = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    points = radius[:, None] * around + np.outer(low + share * (high - low), [0, 0, 1])
    slope = (radius_top - radius_base) / (high - low)
    return points, (1 if outward else -1) * (around - [0, 0, slope])


inner_base, inner_top = BASE_RADIUS_M - WALL_M, TOP_RADIUS_M - WALL_M
parts = (
    cone(1400, BASE_RADIUS_M, TOP_RADIUS_M, 0.0, HEIGHT_M, outward=True),
    cone(1200, inner_base, inner_top, WALL_M, HEIGHT_M, outward=False),
    cone(250, inner_top, TOP_RADIUS_M, HEIGHT_M - 1e-9, HEIGHT_M, outward=True),  # rim
    cone(350, 0.0, inner_base, WALL_M - 1e-9, WALL_M, outward=True),  # floor inside
    cone(300, 0.0, BASE_RADIUS_M, 0.0, 1e-9, outward=True),  # base
)
points = np.concatenate([p for p, _ in parts]) + 3e-4 * rng.normal(size=(3500, 3))
normals = np.concatenate([n for _, n in parts])

tilt_rad = 0.35
turn = np.array(
    [
        [np.cos(tilt_rad), 0.0, np.sin(tilt_rad)],
        [0.0, 1.0, 0.0],
        [-np.sin(tilt_rad), 0.0, np.cos(tilt_rad)],
    ]
)
bowl = ir.ObjectCloud(points @ turn.T + [0.5, 0.2, 0.8], normals @ turn.T)

# %%
# Warp the mug, and compute what pouring needs.

warped = ir.warp_object(mug, bowl)
found = ir.pouring_parameters(warped, toward=np.array([1.0, 0.2, 0.8]))
true_volume_m3 = (
    np.pi * (HEIGHT_M - WALL_M) * (inner_base**2 + inner_base * inner_top + inner_top**2) / 3
)
print(f"volume {1e6 * found.volume_m3:.0f} ml, true {1e6 * true_volume_m3:.0f} ml")
true_radius_m = TOP_RADIUS_M - WALL_M / 2
print(f"opening radius {1e3 * found.opening_radius_m:.1f} mm, true {1e3 * true_radius_m:.1f} mm")
print(f"height {1e3 * found.height_m:.1f} mm, true {1e3 * HEIGHT_M:.1f} mm")
print(f"half is poured at a tilt of {np.degrees(found.tilt_reference_rad):.0f} degrees")

# %%
# The mug with its annotation, and the bowl with the transferred one: rim and container, no handle.
# The cross is the lip, the point of the rim over which the bowl would pour to the right.

figure = plt.figure(figsize=(9, 4), layout="constrained")
views = (
    ("annotated mug", mug.annotated.points, mug.annotated.labels),
    ("warped to the bowl", warped.points, warped.labels),
)
for number, (title, cloud, labels) in enumerate(views, start=1):
    axes = figure.add_subplot(1, 2, number, projection="3d")
    for part in ir.Part:
        chosen = 1e3 * (cloud[labels == part] - cloud.mean(axis=0))
        if len(chosen):
            axes.scatter(*chosen.T, s=3, color=f"C{int(part)}", lw=0, label=part.name.lower())
    axes.set(title=title, xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    axes.set_aspect("equal")
    axes.locator_params(nbins=4)
    if number == 1:
        axes.legend(loc="upper left", markerscale=3)
lip = 1e3 * (found.lip_point - warped.points.mean(axis=0))
axes.plot(*lip[:, None], "x", color="black", ms=9, mew=2, zorder=10)
plt.show()

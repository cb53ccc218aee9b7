# SPDX-License-Identifier: Apache-2.0
"""Figure of a person on the page, posed to the measured wrist."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh
import viser

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.figure import Stance, bone_axes, reach
from intent_recognition.dashboard.things_view import Colour, quaternions

ROOT = "/person"
FIGURE_GREY = (158, 160, 163)
"""Default colour of a figure, red, green and blue from 0 to 255: no skin colour."""
UPPER_ARM_FRAME = "/upper_body/upper_arm"
FOREARM_FRAME = f"{UPPER_ARM_FRAME}/forearm"
MOVED_M = 1e-3
"""Shortest move of the wrist that is drawn [m], above a tracker's noise at rest: each drawn move is
sent to all browsers."""
Ball = tuple[float, float, float, float]
"""Centre (x, y, z) and radius, as fractions of the body's height."""

# Axes forward, left and up from the middle of the hips; paired parts are listed once, for the left.
CHEST: tuple[Ball, ...] = (
    (-0.006, 0.108, 0.276, 0.034),
    (0.004, 0.062, 0.235, 0.05),
    (0.004, 0.05, 0.16, 0.046),
)
WAIST: tuple[Ball, ...] = ((0.004, 0.038, 0.17, 0.044), (0.0, 0.042, 0.03, 0.048))
PELVIS: tuple[Ball, ...] = ((0.0, 0.046, 0.012, 0.054), (-0.004, 0.05, -0.03, 0.052))
NECK: tuple[Ball, ...] = ((-0.008, 0.0, 0.27, 0.034), (0.0, 0.0, 0.36, 0.028))
HEAD: tuple[Ball, ...] = (
    (-0.006, 0.0, 0.418, 0.05),
    (0.008, 0.0, 0.42, 0.048),
    (0.03, 0.0, 0.368, 0.022),
    (0.004, 0.0, 0.375, 0.034),
)
LEG: tuple[tuple[Ball, ...], ...] = (
    ((0.0, 0.055, -0.01, 0.05), (0.006, 0.058, -0.245, 0.031)),
    ((0.006, 0.058, -0.245, 0.031), (-0.008, 0.06, -0.475, 0.02)),
    ((-0.03, 0.06, -0.507, 0.023), (0.085, 0.066, -0.513, 0.017)),
)
OTHER_ARM: tuple[tuple[Ball, ...], ...] = (
    ((0.0, 0.129, 0.286, 0.031), (-0.02, 0.15, 0.105, 0.022)),
    ((-0.02, 0.15, 0.105, 0.022), (0.035, 0.148, -0.032, 0.016)),
    ((0.037, 0.147, -0.045, 0.018), (0.058, 0.142, -0.095, 0.014)),
)
UPPER_ARM_BALLS, FOREARM_BALLS = (0.031, 0.023), (0.023, 0.0165)
"""Radii at the start and end of each bone, as fractions of the body's height."""
HAND: tuple[Ball, ...] = (
    (0.0, 0.0, 0.004, 0.0155),
    (0.0, 0.013, 0.034, 0.0145),
    (0.0, -0.013, 0.034, 0.0145),
    (0.004, 0.0, 0.052, 0.011),
)
"""A loose fist: balls along the forearm, from the wrist."""


class PersonView:
    """Draws the figure of a person below a node of the scene; hidden until the first wrist.

    The frames of the bones form a chain, so that a posture is sent as two rotations, plus one
    where the figure leans.
    """

    def __init__(self, server: viser.ViserServer, stance: Stance, root: str, colour: Colour):
        self._server, self._stance, self._path = server, stance, root
        mixed = 0.7 * np.array(FIGURE_GREY) + 0.3 * np.array(colour)
        self._colour = mixed / 255.0
        self._root = self._frame("", wxyz=quaternions(stance.rotation), visible=False)
        self._upper_body = self._frame("/upper_body")
        self._upper_arm = self._frame(UPPER_ARM_FRAME, position=stance.rotation.T @ stance.arm)
        self._forearm = self._frame(FOREARM_FRAME, position=(0.0, 0.0, stance.arm_m[0]))
        self._wrist = np.full(3, np.nan)
        self._build()

    def update(self, wrist: Floats) -> None:
        """Pose the figure with its wrist at a point (3,) [m], unless it is there already."""
        if np.abs(wrist - self._wrist).max() <= MOVED_M:
            return
        self._wrist = wrist
        posture = reach(self._stance, wrist)
        self._root.position = posture.hip
        upper_arm = bone_axes(posture.elbow - posture.shoulder, self._stance.pole)
        forearm = bone_axes(wrist - posture.elbow, self._stance.pole)
        parents = (self._stance.rotation, posture.upper_body, upper_arm)
        axes = (posture.upper_body, upper_arm, forearm)
        turned = quaternions(np.swapaxes(parents, 1, 2) @ np.array(axes))
        for handle, wxyz in zip(
            (self._upper_body, self._upper_arm, self._forearm), turned, strict=True
        ):
            handle.wxyz = wxyz
        self._root.visible = True

    def remove(self) -> None:
        """Remove the figure."""
        self._root.remove()

    def _frame(self, name: str, **options: Any) -> viser.FrameHandle:
        return self._server.scene.add_frame(f"{self._path}{name}", show_axes=False, **options)

    def _build(self) -> None:
        stance = self._stance
        upper, fore = (length / stance.height_m for length in stance.arm_m)
        hand = [(x, y, z + fore, r) for x, y, z, r in HAND]
        bones = [
            [(0.0, 0.0, 0.0, first), (0.0, 0.0, length, last)]
            for length, (first, last) in ((upper, UPPER_ARM_BALLS), (fore, FOREARM_BALLS))
        ]
        trunk = [on_sides(balls, 1.0, -1.0) for balls in (CHEST, WAIST, NECK, HEAD)]
        legs = [on_sides(balls, side) for balls in LEG for side in (1.0, -1.0)]
        for name, shapes in (
            ("/upper_body", trunk + [on_sides(balls, -stance.side) for balls in OTHER_ARM]),
            ("/legs", [on_sides(PELVIS, 1.0, -1.0), *legs]),
            (UPPER_ARM_FRAME, bones[:1]),
            (FOREARM_FRAME, [bones[1], hand]),
        ):
            hulls = [around(stance.height_m * np.array(balls)) for balls in shapes]
            shape = trimesh.util.concatenate(hulls)
            self._server.scene.add_mesh_simple(
                f"{self._path}{name}/shape", shape.vertices, shape.faces, color=self._colour
            )


def on_sides(balls: Sequence[Ball], *sides: float) -> list[Ball]:
    """Balls on the left side (1), the right side (-1) or both."""
    return [(x, side * y, z, radius) for x, y, z, radius in balls for side in sides]


def around(balls: Floats) -> trimesh.Trimesh:
    """Convex hull of balls (n, 4): centres and radii."""
    sphere = trimesh.creation.icosphere(subdivisions=2).vertices
    points = balls[:, None, :3] + balls[:, None, 3:] * sphere
    return trimesh.Trimesh(points.reshape(-1, 3)).convex_hull

# SPDX-License-Identifier: Apache-2.0
"""Figures of a warp: the points with their parts, and a cut through the cavity."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import INK, PALETTE, SOFT, new_axes, new_figure, styled
from intent_recognition.warping import Part, PouringParameters, Rim, WarpedObject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PART_COLOURS = {Part.CONTAINER: PALETTE[0], Part.RIM: PALETTE[1], Part.HANDLE: PALETTE[2]}
MM = 1e3
"""Millimetres in a metre."""


@styled
def parts_figure(views: tuple[tuple[str, Floats, NDArray[np.integer]], ...]) -> "Figure":
    """Points of several objects, coloured by part, each upright in its own frame.

    Args:
        views: title, local points (n, 3) [m] with the first axis up, and labels (n,) of each.
    """
    figure = new_figure(4.2 * len(views), 4.0)
    for number, (title, points, labels) in enumerate(views):
        axes = figure.add_subplot(1, len(views), number + 1, projection="3d")
        for part, colour in PART_COLOURS.items():
            chosen = points[labels == part] * MM
            if len(chosen):
                axes.scatter(
                    chosen[:, 1],
                    chosen[:, 2],
                    chosen[:, 0],
                    s=4.0,
                    color=colour,
                    linewidths=0.0,
                    label=part.name.lower(),
                )
        axes.set_title(f"{title} [mm]")
        axes.set_aspect("equal")
        axes.view_init(28.0, -62.0)
        axes.tick_params(labelsize=7, pad=-2)
        axes.locator_params(nbins=5)
        if number == 0:
            axes.legend(loc="upper left", markerscale=2.5)
    return figure


@styled
def cut_figure(warped: WarpedObject, parameters: PouringParameters) -> "Figure":
    """Cut along the lip: points near it, the cavity, and the level that leaves half of it."""
    rim, cavity = warped.rim, warped.cavity
    along = parameters.lip_point - rim.centre
    along = along - (along @ rim.up) * rim.up
    along /= np.linalg.norm(along)
    side = np.cross(rim.up, along)
    offsets = warped.points - rim.centre
    near = np.abs(offsets @ side) < 0.12 * parameters.opening_radius_m
    figure, axes = new_axes(5.4, 4.2)
    for part, colour in PART_COLOURS.items():
        here = offsets[near & (warped.labels == part)] * MM
        axes.scatter(here @ along, here @ rim.up, s=9.0, color=colour, label=part.name.lower())
    profile = cavity.profile * MM
    for sign in (-1.0, 1.0):
        width = profile[:, 0] * _outline(rim, sign * along)
        axes.plot(sign * width, -profile[:, 1], color=INK, linewidth=1.4)
    reach = MM * parameters.opening_radius_m
    level = np.array([-2.6 * reach, 0.0]) + MM * (parameters.lip_point - rim.centre) @ along
    drop = np.tan(parameters.tilt_reference_rad) * (level - level[1])
    axes.plot(level, drop, color=SOFT, linestyle="--", linewidth=1.3, label="level at half")
    axes.set_ylim(-1.12 * MM * parameters.height_m, 0.25 * MM * parameters.height_m)
    axes.set_aspect("equal")
    axes.set(xlabel="toward the lip [mm]", ylabel="above the rim [mm]")
    axes.legend(loc="upper center", ncols=4)
    return figure


def _outline(rim: Rim, direction: Floats) -> float:
    """The rim's distance from its centre in a direction, in mean radii."""
    local = rim.axes[1:] @ direction
    angles = np.arange(len(rim.outline)) * 2.0 * np.pi / len(rim.outline)
    radii = np.linalg.norm(rim.outline, axis=1)
    angle = np.arctan2(local[1], local[0])
    return float(np.interp(angle, angles, radii, period=2.0 * np.pi)) / rim.radius_m

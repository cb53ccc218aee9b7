# SPDX-License-Identifier: Apache-2.0
"""The report of one warp: its parameters, the points by part, and a section."""

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.report import html
from intent_recognition.report.drawing import (
    INK,
    PALETTE,
    SOFT,
    Drawing,
    Look,
    new_axes,
    new_figure,
    styled,
    svg_figure,
    to_png,
)
from intent_recognition.warping import ObjectModel, Part, PouringParameters, WarpedObject

PART_COLOURS = {Part.CONTAINER: PALETTE[0], Part.RIM: PALETTE[1], Part.HANDLE: PALETTE[2]}
CUT = (
    "Cut along the lip. The line is the fitted cavity; the dashed one is the level of what is"
    " left when the container is tilted about its lip until half of its volume is above it."
)
MM = 1e3
"""Millimetres in a metre."""


def warp_page(
    source: ObjectModel, warped: WarpedObject, parameters: PouringParameters, subtitle: str
) -> html.ReportPage:
    """The report of a warp."""
    own = source.annotated
    views = (
        (f"annotated: {own.name}", source.frame.to_local(own.points), own.labels),
        ("warped", warped.frame.to_local(warped.points), warped.labels),
    )
    parts = html.Figure(to_png(parts_figure(views)), "Points by part.")
    cut = svg_figure(cut_figure(warped, parameters), CUT)
    degrees = np.degrees(parameters.tilt_reference_rad)
    numbers = (
        html.KeyNumber("opening radius", f"{1e3 * parameters.opening_radius_m:.1f} mm"),
        html.KeyNumber("volume", f"{1e6 * parameters.volume_m3:.0f} ml"),
        html.KeyNumber("height", f"{1e3 * parameters.height_m:.1f} mm"),
        html.KeyNumber("tilt that leaves half", f"{degrees:.1f}\N{DEGREE SIGN}"),
    )
    measured = html.Section("Parameters", (html.KeyNumbers(numbers),))
    sections = (measured, html.Section("Parts", (parts,)), html.Section("Cavity", (cut,)))
    return html.ReportPage("Warped object", subtitle, sections)


@styled
def parts_figure(views: tuple[tuple[str, Floats, NDArray[np.integer]], ...]) -> Drawing:
    """Points of several objects, coloured by part, each upright in its own frame.

    Args:
        views: per object its title, local points (n, 3) [m], first axis up, and labels (n,).
    """
    figure = new_figure(4.2 * len(views), 4.0)
    for number, (title, points, labels) in enumerate(views):
        axes = figure.add_subplot(1, len(views), number + 1, projection="3d")
        for part, colour in PART_COLOURS.items():
            chosen = points[labels == part] * MM
            if len(chosen):
                up, *level = chosen.T
                look: Look = {"color": colour, "linewidths": 0.0, "label": part.name.lower()}
                axes.scatter(*level, up, s=4.0, **look)
        axes.set_title(f"{title} [mm]")
        axes.set_aspect("equal")
        axes.view_init(28.0, -62.0)
        axes.tick_params(labelsize=7, pad=-2)
        axes.locator_params(nbins=5)
        if number == 0:
            axes.legend(loc="upper left", markerscale=2.5)
    return figure


@styled
def cut_figure(warped: WarpedObject, parameters: PouringParameters) -> Drawing:
    """Section along the lip: points near it, the cavity, and the level that leaves half of it."""
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
        width = profile[:, 0] * rim.shape((rim.axes[1:] @ (sign * along))[None])
        axes.plot(sign * width, -profile[:, 1], color=INK, linewidth=1.4)
    reach = MM * parameters.opening_radius_m
    level = np.array([-2.6 * reach, 0.0]) + MM * (parameters.lip_point - rim.centre) @ along
    drop = np.tan(parameters.tilt_reference_rad) * (level - level[1])
    axes.plot(level, drop, color=SOFT, linestyle="--", linewidth=1.3, label="level at half")
    axes.set_ylim(-1.12 * MM * parameters.height_m, 0.25 * MM * parameters.height_m)
    figure.set_figheight(min(4.2, 1.0 + 1.9 * parameters.height_m / parameters.opening_radius_m))
    axes.set_aspect("equal")
    axes.set(xlabel="toward the lip [mm]", ylabel="above the rim [mm]")
    axes.legend(loc="upper center", ncols=4)
    return figure

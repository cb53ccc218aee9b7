# SPDX-License-Identifier: Apache-2.0
"""Figures of boxes in the way: how near the arm comes, and courses that were bent."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from experiments.clearance.study import ClearanceRun
from intent_recognition.kinematics import Box
from intent_recognition.report import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    Drawing,
    new_axes,
    new_figure,
    shared_legend,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "as before": NONE_COLOUR,
    "bent": PALETTE[2],
    "replanned": PALETTE[0],
    "refused": PALETTE[1],
}
"""Colour of each outcome."""


@styled
def nearest_figure(runs: Sequence[ClearanceRun], clearance_m: float) -> Drawing:
    """Least distance from a box in each run: of the guarded arm over that without boxes."""
    figure, axes = new_axes(6.4, 4.6)
    for outcome, colour in COLOURS.items():
        own = [run for run in runs if run.outcome == outcome]
        axes.plot(
            [100 * run.free_m for run in own], [100 * run.guarded_m for run in own],
            "o", markersize=4.5, color=colour, label=f"{outcome} ({len(own)})",
        )  # fmt: skip
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    axes.axhline(100 * clearance_m, color=INK, linestyle=DASHED, linewidth=0.8, label="clearance")
    axes.set_xlabel("without boxes: least distance from where they stand [cm]")
    axes.set_ylabel("guarded: least distance [cm]")
    axes.legend(loc="upper left")
    return figure


@styled
def courses_figure(runs: Sequence[ClearanceRun]) -> Drawing:
    """The hand's way to the handover without boxes and with the guard, among them, from above and
    from the side; one row for each of some runs.
    """
    figure = new_figure(8.2, 2.9 * len(runs))
    grid = figure.subplots(len(runs), 2, squeeze=False)
    for row, run in zip(grid, runs, strict=True):
        for axes, (x, y) in zip(row, ((0, 1), (0, 2)), strict=True):
            for box in run.boxes:
                _fill(axes, box, x, y)
            for name, done, style in (
                ("without boxes", run.free, DASHED),
                ("guarded", run.guarded, "-"),
            ):
                hand = done.hand_m[: done.interacting]
                colour = INK if done is run.free else COLOURS["bent"]
                axes.plot(hand[:, x], hand[:, y], color=colour, linestyle=style, label=name)
            axes.set(xlabel="hand x [m]", ylabel=f"hand {'xyz'[y]} [m]")
            axes.set_aspect("equal", adjustable="datalim")
        row[0].set_title(f"{run.task}, from above")
        row[1].set_title("from the side")
    shared_legend(figure, grid.ravel(), 3)
    return figure


def _fill(axes: "Axes", box: Box, x: int, y: int) -> None:
    """The outline of a box seen along an axis: the convex hull of its corners."""
    from scipy.spatial import ConvexHull

    corners: NDArray[np.float64] = np.array(
        np.meshgrid(*([-0.5, 0.5],) * 3), dtype=np.float64
    ).reshape(3, -1)
    world = np.array(box.center)[:, None] + box.rotation @ (corners * np.array(box.size)[:, None])
    seen = world[[x, y]].T
    outline = seen[ConvexHull(seen).vertices]
    axes.fill(outline[:, 0], outline[:, 1], color=PALETTE[0], alpha=0.3, linewidth=0)

# SPDX-License-Identifier: Apache-2.0
"""The figure of boxes in the way: how near the arm comes."""

from collections.abc import Sequence

from experiments.clearance.study import ClearanceRun
from intent_recognition.report import DASHED, INK, NONE_COLOUR, PALETTE, Drawing, new_axes, styled

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

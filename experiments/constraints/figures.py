# SPDX-License-Identifier: Apache-2.0
"""Figure of the task constraints: ROC curves on the training object and on novel ones."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from experiments.constraints.roc import GRID
from intent_recognition.array_types import Floats
from intent_recognition.report import NONE_COLOUR, PALETTE, Drawing, new_figure, styled

LINE_STYLES = (("-", 3.2), ((0, (4, 1.5)), 1.4), ((0, (1, 1)), 1.8))
"""Dashes and width: the first two often coincide."""
COLOURS = (PALETTE[5], PALETTE[2], PALETTE[1])


class RocBand(NamedTuple):
    """The curves of many training sets.

    Attributes:
        mean: true positive rate on `GRID` (G,).
        low: of the lower quartile (G,).
        high: of the upper quartile (G,).
        area: mean area below the curves.
    """

    mean: Floats
    low: Floats
    high: Floats
    area: float


class RocPanel(NamedTuple):
    """One test set: its title and one band per method."""

    title: str
    bands: Mapping[str, RocBand]


@styled
def roc_figure(rows: Sequence[Sequence[RocPanel]]) -> Drawing:
    """Rows of panels of ROC curves: mean and quartiles over training sets, areas in the legends."""
    count = len(rows[0])
    figure = new_figure(4.4 * count, 4.1 * len(rows))
    grid = figure.subplots(len(rows), count, sharex=True, sharey=True, squeeze=False)
    for axes, panel in zip(grid.ravel(), (p for row in rows for p in row), strict=True):
        axes.plot((0.0, 1.0), (0.0, 1.0), color=NONE_COLOUR, linewidth=0.9)
        for (name, band), colour, (dashes, width) in zip(
            panel.bands.items(), COLOURS, LINE_STYLES, strict=False
        ):
            axes.fill_between(GRID, band.low, band.high, color=colour, alpha=0.15, linewidth=0)
            label = f"{name}  {band.area:.3f}"
            axes.plot(GRID, band.mean, color=colour, linestyle=dashes, linewidth=width, label=label)
        axes.set_title(panel.title)
        axes.legend(loc="lower right", title="mean area", alignment="right")
        axes.set_aspect("equal")
        axes.set(xlim=(-0.02, 1.0), ylim=(0.0, 1.02))
    for axes in grid[-1]:
        axes.set_xlabel("false positive rate")
    for axes in grid[:, 0]:
        axes.set_ylabel("true positive rate")
    return figure

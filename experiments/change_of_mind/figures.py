# SPDX-License-Identifier: Apache-2.0
"""The figure of changes of mind: what became of them."""

from collections.abc import Mapping

import numpy as np

from intent_recognition.report import (
    INK,
    NONE_COLOUR,
    PALETTE,
    Drawing,
    new_figure,
    shared_legend,
    styled,
)

NEW, OLD = PALETTE[2], PALETTE[1]


@styled
def outcome_figure(
    panels: Mapping[str, Mapping[float, tuple[float, float]]], wanted: Mapping[float, float]
) -> Drawing:
    """What was active at the end, over the moment of the change, one panel per kind of change.

    Args:
        panels: by title and share of the movement, shares with the new and with the old task.
        wanted: least share with the new task that is wanted, by share of the movement.
    """
    figure = new_figure(2.6 * len(panels), 3.4)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (title, cells) in zip(grid, panels.items(), strict=True):
        at = np.arange(len(cells))
        new, old = 100.0 * np.array(list(cells.values())).T
        axes.bar(at, new, color=NEW, label="new task active")
        axes.bar(at, old, bottom=100.0 - old, color=OLD, label="old task kept")
        axes.bar(at, 100.0 - old - new, bottom=new, color=NONE_COLOUR, alpha=0.35, label="neither")
        for k, share in enumerate(cells):
            if share in wanted:
                level = 100.0 * wanted[share]
                axes.plot([k - 0.4, k + 0.4], [level] * 2, color=INK, label="wanted")
        axes.set_xticks(at, [f"{share:.0%}" for share in cells])
        axes.set(xlabel="change at", title=title, ylim=(0.0, 100.0))
        axes.grid(visible=False, axis="x")
    grid[0].set_ylabel("reaches [%]")
    shared_legend(figure, grid, 4)
    return figure

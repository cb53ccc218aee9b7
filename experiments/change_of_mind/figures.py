# SPDX-License-Identifier: Apache-2.0
"""Figures of changes of mind: the hand's courses, what became of them, and how soon."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

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

NEW, OLD = PALETTE[2], PALETTE[1]


@styled
def courses_figure(
    courses: Mapping[str, NDArray[np.float64]], references: Mapping[str, NDArray[np.float64]]
) -> Drawing:
    """Planned courses of the wrist, from above and from the side.

    Args:
        courses: changed reaches by name, (T, 3) each [m].
        references: the reaches they go over from and to, likewise.
    """
    figure = new_figure(8.6, 3.9)
    grid = figure.subplots(1, 2)
    for axes, (x, y), title in zip(
        grid, ((0, 1), (0, 2)), ("from above", "from the side"), strict=True
    ):
        for name, path in references.items():
            axes.plot(path[:, x], path[:, y], color=INK, linestyle=DASHED, lw=1.2, label=name)
        for colour, (name, path) in zip(PALETTE, courses.items(), strict=False):
            axes.plot(path[:, x], path[:, y], color=colour, label=name)
        axes.set(title=title, xlabel="wrist x [m]", ylabel=f"wrist {'xyz'[y]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
    shared_legend(figure, grid, 3)
    return figure


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


@styled
def delay_figure(delays_s: Mapping[str, Sequence[float]], counts: Mapping[str, int]) -> Drawing:
    """Share of reaches with the new task active, over the time since the change.

    Args:
        delays_s: of those with the new task active at the end, by name.
        counts: all reaches, by name.
    """
    figure, axes = new_axes(5.2, 3.6)
    for colour, (name, delays) in zip(PALETTE, delays_s.items(), strict=False):
        ordered = np.sort(np.asarray(delays, dtype=np.float64))
        share = 100.0 * np.arange(len(ordered) + 1) / counts[name]
        axes.step(np.r_[0.0, ordered], share, where="post", color=colour, label=name)
    axes.set_xlabel("time since the change [s]")
    axes.set_ylabel("new task active [%]")
    axes.set_ylim(0.0, 100.0)
    axes.set_xlim(left=0.0)
    axes.legend()
    return figure

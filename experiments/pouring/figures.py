# SPDX-License-Identifier: Apache-2.0
"""Figures of pouring: the primitive in the warped space and in metres, and balls spilled."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.typing import LineStyleType

from intent_recognition.array_types import Floats
from intent_recognition.report import (
    NONE_COLOUR,
    PALETTE,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_axes,
    new_figure,
    styled,
)

WARPED_TITLES = (
    "along / radius of the second",
    "across / radius of the second",
    "up / height of the cup",
    "tilt / reference tilt",
)
REAL_TITLES = ("along [cm]", "across [cm]", "up [cm]", "tilt [deg]")
MEAN_COLOUR, INSIDE_COLOUR = PALETTE[0], PALETTE[1]
PAIR_COLOURS = (PALETTE[2], PALETTE[3], PALETTE[4])
DASHES: tuple[LineStyleType, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)))


class Band(NamedTuple):
    """A distribution over paths: times or phases (T,), mean (T, 4), standard deviation (T, 4)."""

    time: Floats
    mean: Floats
    std: Floats


class Real(NamedTuple):
    """One pair: its name, the rescaled primitive, and times and path (T, 4) of the arm.

    Centimetres and degrees.
    """

    name: str
    band: Band
    done_s: Floats
    done: Floats


@styled
def paths_figure(
    warped: Band, demonstrations: Sequence[tuple[Floats, Floats]], real: Sequence[Real]
) -> Drawing:
    """Above the primitive in the warped space, below what it becomes for some pairs.

    Args:
        warped: the primitive over phase.
        demonstrations: phases (T,) and ratios (T, 4) of each.
        real: up to three pairs.
    """
    figure = new_figure(12.0, 6.4)
    grid = figure.subplots(2, 4)
    inside = np.hypot(warped.mean[:, 0], warped.mean[:, 1]) < 1.0
    for k, axes in enumerate(grid[0]):
        axes.fill_between(
            warped.time, 0.0, 1.0, where=inside, transform=axes.get_xaxis_transform(),
            color=INSIDE_COLOUR, alpha=0.10, lw=0, label="lip above the opening",
        )  # fmt: skip
        for at in (-1.0, 1.0) if k < 2 else (1.0,):
            axes.axhline(at, color="black", lw=0.9, zorder=1)
        for phase, path in demonstrations:
            axes.plot(phase, path[:, k], color=NONE_COLOUR, lw=0.6, alpha=0.8)
        _band(axes, warped, k, MEAN_COLOUR, "mean, $\\pm$2 sigma", "-")
        axes.set(title=WARPED_TITLES[k], xlim=(0.0, 1.0), xlabel="phase")
    grid[0, 1].set_ylim(-1.6, 1.6)
    for k, axes in enumerate(grid[1]):
        for one, colour, dashes in zip(real, PAIR_COLOURS, DASHES, strict=False):
            _band(axes, one.band, k, colour, one.name, dashes)
            axes.plot(one.done_s, one.done[:, k], color=SOFT, lw=0.8, linestyle=(0, (1, 1)))
        axes.set_title(REAL_TITLES[k])
        axes.set_xlim(0.0, max(one.done_s[-1] for one in real))
        axes.set_xlabel("time [s]")
    axes = grid[1, 0]
    axes.plot([], [], color=SOFT, lw=0.8, linestyle=(0, (1, 1)), label="the arm")
    upper, lower = (row[0].get_legend_handles_labels() for row in grid)
    figure.legend(*upper, loc="outside upper center", ncols=len(upper[1]))
    figure.legend(*lower, loc="outside lower center", ncols=len(lower[1]))
    return figure


def _band(axes: Axes, band: Band, k: int, colour: str, label: str, dashes: LineStyleType) -> None:
    fill_two_sigma(axes, band.time, band.mean[:, k], band.std[:, k], colour, alpha=0.2)
    axes.plot(band.time, band.mean[:, k], color=colour, linestyle=dashes, label=label)


@styled
def spilled_figure(
    pairs: Sequence[str], spilled: Mapping[str, Sequence[int]], n_balls: int
) -> Drawing:
    """Bars of balls spilled of `n_balls` per pair, one colour per way to pour."""
    figure, axes = new_axes(10.5, 4.0)
    width, places = 0.8 / len(spilled), np.arange(len(pairs))
    colours = (PALETTE[2], PALETTE[5], PALETTE[1])
    for k, ((name, counts), colour) in enumerate(zip(spilled.items(), colours, strict=False)):
        at = places + (k - 0.5 * (len(spilled) - 1)) * width
        bars = axes.bar(at, counts, 0.92 * width, color=colour, label=name)
        axes.bar_label(bars, fontsize=8.5, padding=1)
    axes.set_xticks(places, [name.replace(" into ", "\ninto ") for name in pairs])
    axes.set_ylabel(f"balls spilled of {n_balls}")
    axes.set_ylim(0.0, 1.08 * max(5, *(max(counts) for counts in spilled.values())))
    axes.grid(visible=False, axis="x")
    axes.legend(loc="upper left")
    return figure

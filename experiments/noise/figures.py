# SPDX-License-Identifier: Apache-2.0
"""Figures of the experiment on noise: errors over observed samples and over the noise."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from intent_recognition.report import DASHED, PALETTE, SOFT, Drawing, new_figure, styled

BAND = 2.0
"""Standard errors on both sides of a mean."""
TICKS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Marks of the axis of errors."""


@styled
def noise_figure(
    panels: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
    levels: Sequence[float],
    counts: Sequence[int],
) -> Drawing:
    """Bars of the error over the number of observed samples, one colour per level of noise.

    Args:
        panels: per title, mean and standard error of the error, (L, k) each.
        levels: noise variances, (L,).
        counts: observed samples, (k,).
    """
    figure = new_figure(4.6 * len(panels), 3.5)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    colours = _shades(len(levels))
    width = 0.8 / len(levels)
    for axes, (title, (mean, error)) in zip(grid, panels.items(), strict=True):
        for row, level in enumerate(levels):
            x = np.arange(len(counts)) + width * (row - 0.5 * (len(levels) - 1))
            axes.bar(
                x,
                mean[row],
                0.92 * width,
                yerr=BAND * error[row],
                color=colours[row],
                ecolor=SOFT,
                error_kw={"elinewidth": 1.0, "capsize": 1.5},
                label=f"{level:g}",
            )
        axes.set_xticks(range(len(counts)), [str(count) for count in counts])
        axes.grid(visible=False, axis="x")
        axes.set(title=title, xlabel=f"observed samples (of {max(counts)})")
    grid[0].set_ylabel("RMSE of the predicted agent [sketch units]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, title="noise variance", loc="outside right center", reverse=True)
    return figure


@styled
def growth_figure(
    panels: Mapping[str, Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]],
    levels: Sequence[float],
    styles: Mapping[str, tuple[int, bool, str]],
) -> Drawing:
    """Error over the noise variance, a line per method, +- two standard errors.

    The axis of the errors is logarithmic; a band that would reach below half its line ends there.

    Args:
        panels: per title and method, mean and standard error, (L,) each.
        levels: noise variances, (L,).
        styles: per method, number of its colour, whether it is dashed, its marker.
    """
    figure = new_figure(4.6 * len(panels), 4.4)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    means = np.array([mean for lines in panels.values() for mean, _ in lines.values()])
    lowest, highest = means.min(), means.max()
    for axes, (title, lines) in zip(grid, panels.items(), strict=True):
        for name, (mean, error) in lines.items():
            number, dashed, marker = styles[name]
            low, high = np.maximum(mean - BAND * error, 0.5 * mean), mean + BAND * error
            axes.fill_between(levels, low, high, color=PALETTE[number], alpha=0.15, linewidth=0)
            axes.plot(
                levels,
                mean,
                color=PALETTE[number],
                linestyle=DASHED if dashed else "-",
                marker=marker,
                markersize=5.5,
                markeredgecolor="white",
                label=name,
            )
        axes.set_title(title)
        axes.set_xticks(levels, [f"{level:g}" for level in levels])
        axes.set_xlabel("noise variance [sketch units²]")
        axes.set_yscale("log")
        axes.set_yticks(TICKS, [f"{tick:g}" for tick in TICKS])
        axes.minorticks_off()
        axes.set_ylim(0.8 * lowest, 1.2 * highest)
    grid[0].set_ylabel("RMSE of the predicted agent [sketch units]")
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2, handlelength=3.0)
    return figure


def _shades(n: int) -> list:
    """Colours from light to dark of one hue."""
    from matplotlib import colormaps

    return [colormaps["viridis"](share) for share in np.linspace(0.85, 0.1, n)]

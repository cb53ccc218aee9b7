# SPDX-License-Identifier: Apache-2.0
"""The figure of the experiment on noise: errors over observed samples."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import colormaps

from intent_recognition.array_types import Floats
from intent_recognition.report import SOFT, Drawing, new_figure, styled

BAND = 2.0
"""Standard errors on both sides of a mean."""


@styled
def noise_figure(
    panels: Mapping[str, tuple[Floats, Floats]], levels: Sequence[float], counts: Sequence[int]
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


def _shades(n: int) -> list:
    """Colours from light to dark of one hue."""
    return [colormaps["viridis"](share) for share in np.linspace(0.85, 0.1, n)]

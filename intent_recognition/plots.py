# SPDX-License-Identifier: Apache-2.0
"""Drawing for the methods `.plot()`; matplotlib is loaded only when they are called.

Names may contain dollar signs, which must not start mathematical text.
"""

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.errors import optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # lets annotations resolve without matplotlib
    Axes = Figure = Any


def draw_bands(
    axes: Axes, times_s: Floats, mean: Floats, std: Floats, names: Sequence[str]
) -> None:
    """Draw the means of d DOFs over time, each with a band of two standard deviations.

    Args:
        axes: panel to draw into.
        times_s: times (T,).
        mean: means (T, d).
        std: standard deviations (T, d).
        names: names of the DOFs.
    """
    for k, name in enumerate(names):
        (line,) = axes.plot(times_s, mean[:, k], label=name)
        half = 2.0 * std[:, k]
        band = (mean[:, k] - half, mean[:, k] + half)
        axes.fill_between(times_s, *band, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set_xlabel("time since onset [s]")


def name_lines(axes: Axes) -> None:
    """Add a legend of the lines beside a panel."""
    anchor = 1.0, 0.5
    legend = axes.legend(fontsize="small", loc="center left", bbox_to_anchor=anchor, frameon=False)
    for text in legend.get_texts():
        text.set_parse_math(False)


def draw_shares(axes: Axes, labels: Sequence[str], shares: Floats) -> None:
    """Draw probabilities as bars, the first label on top."""
    bars = axes.barh(range(len(labels)), shares)
    axes.bar_label(bars, fmt="%.2f", padding=3)
    axes.set_yticks(range(len(labels)), labels, parse_math=False)
    axes.invert_yaxis()
    axes.set_xlim(0.0, 1.12)
    axes.set_xlabel("probability")


def new_panels(n_rows: int = 1, n_columns: int = 1) -> tuple[Figure, NDArray[np.object_]]:
    """A pyplot figure and its panels (n_rows, n_columns), each row with one scale."""
    size = (max(5.0, 3.2 * n_columns), 2.4 * n_rows + 0.6)
    figure = optional("matplotlib.pyplot").figure(figsize=size, layout="constrained")
    return figure, figure.subplots(n_rows, n_columns, sharey="row", squeeze=False)


def by_unit(units: Sequence[str]) -> list[tuple[str, list[int]]]:
    """Runs of consecutive equal units, with their indices; each run fits one panel."""
    return [(unit, list(run)) for unit, run in groupby(range(len(units)), lambda k: units[k])]

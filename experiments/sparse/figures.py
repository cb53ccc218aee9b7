# SPDX-License-Identifier: Apache-2.0
"""Figures of the experiment on sparse observations: one example, and errors over many."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from intent_recognition.array_types import Floats
from intent_recognition.report import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_figure,
    shared_legend,
    styled,
)

PRIOR, POSTERIOR = PALETTE[0], PALETTE[2]
LINES = (PALETTE[1], PALETTE[3], PALETTE[5])


class Panel(NamedTuple):
    """One agent's curve, before and after.

    Attributes:
        title: above the panel.
        prior: mean and standard deviation, (T,) each.
        posterior: the same after the observations.
        true: the curve, (T,).
        seen: phases and positions observed, (m,) each, or None.
        others: further predictions by name, (T,) each.
    """

    title: str
    prior: tuple[Floats, Floats]
    posterior: tuple[Floats, Floats]
    true: Floats
    seen: tuple[Floats, Floats] | None = None
    others: Mapping[str, Floats] | None = None


@styled
def example_figure(phase: Floats, examples: Sequence[Sequence[Panel]]) -> Drawing:
    """Prior and posterior of both agents, +- two standard deviations; one column per example.

    Args:
        phase: of the curves, (T,).
        examples: panels of the observed and of the controlled agent.
    """
    figure = new_figure(4.6 * len(examples), 6.2)
    grid = figure.subplots(2, len(examples), sharex=True, sharey="row", squeeze=False)
    for column, example in enumerate(examples):
        for axes, panel in zip(grid[:, column], example, strict=True):
            _draw(axes, phase, panel)
            if panel.title:
                axes.set_title(panel.title)
        grid[1, column].set_xlabel("phase")
    grid[0, 0].set_ylabel("observed agent [sketch units]")
    grid[1, 0].set_ylabel("controlled agent [sketch units]")
    shared_legend(figure, grid.T.ravel(), 3)
    return figure


def _draw(axes: Axes, phase: Floats, panel: Panel) -> None:
    for (mean, std), colour, name in (
        (panel.prior, PRIOR, "prior"),
        (panel.posterior, POSTERIOR, "ProMP given the observations"),
    ):
        label = f"{name}, \N{PLUS-MINUS SIGN} 2 std"
        fill_two_sigma(axes, phase, mean, std, colour, alpha=0.22)
        axes.plot(phase, mean, color=colour, label=label)
    axes.plot(phase, panel.true, color=INK, linestyle=DASHED, linewidth=1.4, label="true")
    for (name, values), colour in zip((panel.others or {}).items(), LINES, strict=False):
        axes.plot(phase, values, color=colour, linestyle=(0, (1, 1)), label=name)
    if panel.seen is not None:
        axes.plot(
            *panel.seen,
            "o",
            color=INK,
            markersize=6 if len(panel.seen[0]) < 12 else 3,
            markeredgecolor="white",
            markeredgewidth=0.6,
            label="observations",
        )
    axes.set_xlim(0.0, 1.0)


class Line(NamedTuple):
    """Mean and standard error over numbers of observations, (k,) each."""

    mean: Floats
    error: Floats


@styled
def sparse_error_figure(
    counts: Sequence[int], rmse: Mapping[str, Line], at: Floats, accelerations: Mapping[str, Floats]
) -> Drawing:
    """Error over the number of observations, and what a spline makes of an acceleration.

    Args:
        counts: numbers of observations, (k,).
        rmse: per method, over the counts; the last is drawn as a grey line.
        at: phases of the accelerations, (T,).
        accelerations: by name, the true one first, (T,) each.
    """
    figure = new_figure(9.2, 4.0)
    left, right = figure.subplots(1, 2)
    colours = (POSTERIOR, *LINES[:2], NONE_COLOUR)
    for (name, line), colour, marker in zip(
        rmse.items(), colours, ("o", "s", "^", ""), strict=True
    ):
        fill_two_sigma(left, np.asarray(counts), line.mean, line.error, colour)
        left.plot(
            counts,
            line.mean,
            color=colour,
            marker=marker,
            markersize=5.5,
            markeredgecolor="white",
            linestyle="-" if marker else DASHED,
            label=name,
        )
    left.set_xticks(counts)
    left.set_ylim(bottom=0.0)
    left.set_xlabel("observations")
    left.set_ylabel("RMSE [sketch units]")
    left.set_title("prediction of the controlled agent")
    for number, (name, values) in enumerate(accelerations.items()):
        style = {"color": INK, "linestyle": DASHED} if not number else {}
        right.plot(at, values, **({"color": LINES[(number - 1) % len(LINES)]} | style), label=name)
    right.axhline(0.0, color=SOFT, linewidth=0.8)
    right.set_xlabel("phase")
    right.set_ylabel("acceleration [sketch units / phase²]")
    right.set_title("acceleration of the observed agent")
    for axes in (left, right):
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=1)
    return figure

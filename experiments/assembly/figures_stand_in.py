# SPDX-License-Identifier: Apache-2.0
"""Figures of the second human's prediction, and of the arm in that human's place."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.report import (
    DASHED,
    INK,
    SOFT,
    Drawing,
    fill_two_sigma,
    new_axes,
    new_figure,
    readable,
    styled,
    task_colours,
    task_markers,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.typing import LineStyleType

PREDICTED_LINE: "LineStyleType" = (0, (4, 1.6))
MINUS = "\N{MINUS SIGN}"


class WristPrediction(NamedTuple):
    """The assistant's wrist over time: as it was, and as predicted; (T,) and (T, 3)."""

    times_s: NDArray[np.float64]
    truth_m: NDArray[np.float64]
    mean_m: NDArray[np.float64]
    std_m: NDArray[np.float64]


class Hand(NamedTuple):
    """The arm's hand over time, and where the assistant's wrist was; (T,) and (T, 3).

    `began_s` is when the arm began to move.
    """

    times_s: NDArray[np.float64]
    wrist_m: NDArray[np.float64]
    hand_m: NDArray[np.float64]
    began_s: float


@styled
def prediction_error_figure(
    known_cm: Mapping[str, NDArray[np.float64]],
    unknown_cm: Mapping[str, NDArray[np.float64]],
    mean_cm: Mapping[str, float],
    quantity: str,
) -> Drawing:
    """Mean error over the number of observations, per task, beside that of the task's mean.

    Args:
        known_cm: per task (n + 1,), the elapsed share known.
        unknown_cm: the same, duration unknown.
        mean_cm: error of the task's mean.
        quantity: for the axis.
    """
    from matplotlib.lines import Line2D

    colours, markers = task_colours(known_cm), task_markers(known_cm)
    figure, axes = new_axes(5.6, 3.9)
    for task, errors in known_cm.items():
        at = np.arange(len(errors))
        axes.plot(at, errors, marker=markers[task], color=colours[task], markersize=4)
        axes.plot(at, unknown_cm[task], linestyle=DASHED, lw=1.3, color=colours[task])
        axes.axhline(mean_cm[task], color=colours[task], lw=0.9, linestyle=(0, (1, 2)))
    axes.set_ylim(bottom=0.0)
    axes.set_xlim(0, len(at) - 1)
    axes.set_xlabel("number of observations")
    axes.set_ylabel(f"{quantity} [cm]")
    handles = [
        Line2D([], [], color=colours[t], marker=markers[t], markersize=4, label=readable(t))
        for t in known_cm
    ]
    handles += [
        Line2D([], [], color=SOFT, linestyle=DASHED, lw=1.3, label="duration unknown"),
        Line2D([], [], color=SOFT, linestyle=(0, (1, 2)), lw=0.9, label="mean of the true task"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@styled
def prediction_figure(examples: Mapping[str, WristPrediction], n_observations: int) -> Drawing:
    """The assistant's wrist as predicted after some observations, with +-2 sigma; a row a task."""
    colours = task_colours(examples)
    figure = new_figure(11.2, 2.1 * len(examples) + 0.5)
    grid = figure.subplots(len(examples), 3, sharex="row", squeeze=False)
    for line, (task, shown) in zip(grid, examples.items(), strict=True):
        for k, axes in enumerate(line):
            colour = colours[task]
            fill_two_sigma(axes, shown.times_s, shown.mean_m[:, k], shown.std_m[:, k], colour)
            axes.plot(shown.times_s, shown.mean_m[:, k], color=colour, linestyle=PREDICTED_LINE)
            axes.plot(shown.times_s, shown.truth_m[:, k], color=INK, lw=1.3)
            axes.set_title(f"{readable(task)}: {'xyz'[k]}")
            axes.set_xlim(shown.times_s[0], shown.times_s[-1])
        line[0].set_ylabel("assistant's wrist [m]")
    for axes in grid[-1]:
        axes.set_xlabel("time after the worker's onset [s]")
    _legend(figure, "as it was", f"predicted after {n_observations} observations", band=True)
    return figure


@styled
def hand_figure(examples: Mapping[str, Hand]) -> Drawing:
    """The arm's hand beside the assistant's wrist it stands in for; a row a task."""
    colours = task_colours(examples)
    figure = new_figure(11.2, 2.1 * len(examples) + 0.5)
    grid = figure.subplots(len(examples), 3, sharex="row", squeeze=False)
    for line, (task, shown) in zip(grid, examples.items(), strict=True):
        for k, axes in enumerate(line):
            axes.axvline(shown.began_s, color=SOFT, lw=1.0, linestyle=(0, (1, 2)))
            axes.plot(shown.times_s, shown.wrist_m[:, k], color=INK, lw=1.3)
            axes.plot(shown.times_s, shown.hand_m[:, k], color=colours[task])
            axes.set_title(f"{readable(task)}: {'xyz'[k]}")
            axes.set_xlim(shown.times_s[0], shown.times_s[-1])
        line[0].set_ylabel("position [m]")
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    _legend(figure, "the assistant's wrist", "the arm's hand", dashed=False, began=True)
    return figure


@styled
def arrival_figure(
    end_cm: Mapping[str, NDArray[np.float64]], late_s: Mapping[str, NDArray[np.float64]]
) -> Drawing:
    """Where and when the hand arrived, compared with the assistant's wrist; a dot a recording."""
    colours, markers = task_colours(end_cm), task_markers(end_cm)
    figure, axes = new_axes(5.6, 3.9)
    axes.axvline(0.0, color=SOFT, lw=1.0)
    for task, errors in end_cm.items():
        axes.scatter(
            late_s[task],
            errors,
            s=30,
            color=colours[task],
            marker=markers[task],
            linewidths=0,
            alpha=0.8,
            label=readable(task),
        )
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(f"hand arrived after the wrist ({MINUS}: before) [s]")
    axes.set_ylabel("hand from wrist at the end [cm]")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


def _legend(
    figure: Drawing,
    truth: str,
    ours: str,
    *,
    band: bool = False,
    dashed: bool = True,
    began: bool = False,
) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    style: LineStyleType = PREDICTED_LINE if dashed else "-"
    handles: list[Artist] = [
        Line2D([], [], color=INK, lw=1.3, label=truth),
        Line2D([], [], color=SOFT, lw=2.6, linestyle=style, label=f"{ours} (coloured)"),
    ]
    if band:
        handles.append(
            Patch(color=SOFT, alpha=0.25, label="\N{PLUS-MINUS SIGN} 2\N{GREEK SMALL LETTER SIGMA}")
        )
    if began:
        dots = (0, (1, 2))
        handles.append(Line2D([], [], color=SOFT, lw=1.0, linestyle=dots, label="the arm begins"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)

# SPDX-License-Identifier: Apache-2.0
"""Figures of the box assembly by two humans: where both move, what overlaps, and recognition."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch

from intent_recognition.array_types import Floats
from intent_recognition.report import (
    INK,
    SOFT,
    Drawing,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
)

WORKER_COLOUR, ASSISTANT_COLOUR = "#0072b2", "#d55e00"
VIEWS = (((0, 1), "from above"), ((0, 2), "from the side"))
N_ELLIPSES = 9
MOST_LINES = 20
"""Demonstrations drawn as lines in a panel; the ellipses are of all of them."""
TWO_SIGMA = "\N{PLUS-MINUS SIGN} 2\N{GREEK SMALL LETTER SIGMA}"


class Tube(NamedTuple):
    """Where a wrist is along a movement: means (T, 3) and covariances (T, 3, 3), metres."""

    mean: Floats
    covariance: Floats


@styled
def workspace_figure(paths: Mapping[str, Floats]) -> Drawing:
    """Both wrists of the aligned demonstrations with 2 sigma ellipses along them (Fig. 7).

    Args:
        paths: per task (n, G, 6): worker's x, y, z, then assistant's, metres.
    """
    figure = new_figure(11.2, 6.2)
    grid = figure.subplots(2, len(paths), squeeze=False, height_ratios=(1.5, 1.0))
    for column, (task, values) in enumerate(paths.items()):
        for row, ((i, j), title) in enumerate(VIEWS):
            axes = grid[row, column]
            for first, colour in ((0, WORKER_COLOUR), (3, ASSISTANT_COLOUR)):
                wrist = values[:, :, first : first + 3]
                some = wrist[:MOST_LINES, ::2]
                axes.plot(some[:, :, i].T, some[:, :, j].T, color=colour, alpha=0.35, lw=0.6)
                _ellipses(axes, _tube(wrist), (i, j), colour)
            axes.set_aspect("equal", adjustable="datalim")
            axes.set_title(f"{readable(task)} ({len(values)})" if row == 0 else "")
            if column == 0:
                axes.set_ylabel(f"{'xyz'[j]} [m], {title}")
            if row == 1:
                axes.set_xlabel("x [m]")
    _agents_legend(figure)
    return figure


@styled
def overlap_figure(
    tubes: Mapping[str, Tube], observations_m: Floats, true: str, n_circled: int
) -> Drawing:
    """Observations of one demonstration over the tubes of two tasks (Fig. 8).

    Args:
        tubes: per task, of the worker's wrist.
        observations_m: (n, 3), in order.
        true: the task they belong to.
        n_circled: how many of the last observations are circled.
    """
    colours = {task: task_colours(ALL_TASKS)[task] for task in tubes}
    figure = new_figure(11.2, 4.1)
    grid = figure.subplots(1, 2)
    for axes, ((i, j), title) in zip(grid, VIEWS, strict=True):
        for task, tube in tubes.items():
            _ellipses(axes, tube, (i, j), colours[task], count=14)
            axes.plot(tube.mean[:, i], tube.mean[:, j], color=colours[task], label=readable(task))
        axes.plot(
            observations_m[:, i],
            observations_m[:, j],
            "o",
            color=INK,
            markersize=4.5,
            label=f"observations of one {readable(true)}",
        )
        late = observations_m[-n_circled:]
        axes.plot(
            late[:, i],
            late[:, j],
            "o",
            color="none",
            markeredgecolor=INK,
            markersize=11,
            label=f"its last {n_circled}",
        )
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(title=title, xlabel="x [m]", ylabel=f"{'xyz'[j]} [m]")
    shared_legend(figure, grid[:1], 4)
    return figure


@styled
def certainty_figure(
    labels: Sequence[str], rows: Mapping[str, Mapping[str, Floats]], certain_after: int
) -> Drawing:
    """Task probabilities over the number of observations, one panel a true task (Fig. 9).

    Args:
        labels: of the tasks, K.
        rows: per way of knowing the progress, per true task, (demonstrations, n + 1, K).
        certain_after: the paper's largest number of observations to certainty.
    """
    colours = task_colours(labels)
    figure = new_figure(11.2, 2.6 * len(rows) + 0.5)
    grid = figure.subplots(len(rows), len(labels), sharex=True, sharey=True, squeeze=False)
    for line, (name, by_task) in zip(grid, rows.items(), strict=True):
        for axes, (true, values) in zip(line, by_task.items(), strict=True):
            axes.axvspan(3, certain_after, color="#eef1f5", zorder=0)
            _bands(axes, labels, values, colours)
            axes.set(title=f"{readable(true)} ({len(values)} left out)", ylim=(-0.03, 1.05))
        line[0].set_ylabel(f"probability\n{name}")
    for axes in grid[-1]:
        axes.set_xlabel("number of observations")
    grid[0, 0].annotate(
        "paper:\n3 to 5",
        (certain_after, 0.5),
        (4, 0),
        textcoords="offset points",
        va="center",
        fontsize=8.5,
        color=SOFT,
    )
    _task_legend(figure, labels, colours)
    return figure


@styled
def ambiguity_figure(labels: Sequence[str], ways: Mapping[str, Floats], true: str) -> Drawing:
    """Task probabilities from single observations and from all so far, for the ambiguous task.

    Args:
        labels: of the tasks, K.
        ways: per way of reading the observations, (demonstrations, n, K).
        true: the task they belong to.
    """
    colours = task_colours(labels)
    figure = new_figure(11.2, 3.3)
    for axes, (name, values) in zip(
        figure.subplots(1, len(ways), sharey=True), ways.items(), strict=True
    ):
        _bands(axes, labels, values, colours, first=1)
        axes.set(title=name, xlabel="observation", ylim=(-0.03, 1.05))
    figure.axes[0].set_ylabel(f"probability\n(true: {readable(true)})")
    _task_legend(figure, labels, colours)
    return figure


ALL_TASKS = ("fastening", "hand_over", "plate_insertion")
"""Labels in the order of their colours, for figures that show some of them."""


def _tube(paths: Floats) -> Tube:
    """Sample mean and covariance at each phase of paths (n, G, 3)."""
    deviation = paths - paths.mean(axis=0)
    covariance = np.einsum("ngi,ngj->gij", deviation, deviation) / (len(paths) - 1)
    return Tube(paths.mean(axis=0), covariance)


def _ellipses(
    axes: Axes, tube: Tube, plane: tuple[int, int], colour: str, count: int = N_ELLIPSES
) -> None:
    """Ellipses of two standard deviations, evenly spaced along the tube's path."""
    for k in _evenly_along(tube.mean, count):
        values, vectors = np.linalg.eigh(tube.covariance[k][np.ix_(plane, plane)])
        width, height = 4.0 * np.sqrt(np.maximum(values, 0.0))
        angle = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
        centre = tube.mean[k][list(plane)]
        shape = {"facecolor": colour, "alpha": 0.10, "linewidth": 0.0}
        axes.add_patch(Ellipse(centre, width, height, angle=angle, **shape))
        edge = {"facecolor": "none", "edgecolor": colour, "linewidth": 0.9, "alpha": 0.75}
        axes.add_patch(Ellipse(centre, width, height, angle=angle, **edge))


def _evenly_along(path: Floats, count: int) -> list[int]:
    """Indices of at most `count` points of a path (T, 3), evenly spaced by its length."""
    length = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    wanted = np.linspace(0.0, length[-1], count)
    return sorted({int(k) for k in np.searchsorted(length, wanted).clip(0, len(path) - 1)})


def _bands(
    axes: Axes, labels: Sequence[str], values: Floats, colours: Mapping[str, str], first: int = 0
) -> None:
    """Median and central 90 % of each task's probability; values (demonstrations, n, K)."""
    at = first + np.arange(values.shape[1])
    for k, label in enumerate(labels):
        low, middle, high = np.quantile(values[:, :, k], (0.05, 0.5, 0.95), axis=0)
        axes.fill_between(at, low, high, color=colours[label], alpha=0.18, linewidth=0)
        axes.plot(at, middle, color=colours[label], marker="o", markersize=3.5)
    axes.set_xlim(at[0], at[-1])


def _task_legend(figure: Drawing, labels: Sequence[str], colours: Mapping[str, str]) -> None:
    handles: list[Artist] = [
        Line2D([], [], color=colours[t], marker="o", markersize=3.5, label=readable(t))
        for t in labels
    ]
    handles.append(Patch(color=SOFT, alpha=0.25, label="90 % of the demonstrations"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4)


def _agents_legend(figure: Drawing) -> None:
    handles = [
        Line2D([], [], color=WORKER_COLOUR, label="worker (observed)"),
        Line2D([], [], color=ASSISTANT_COLOUR, label="assistant (predicted)"),
        Line2D([], [], marker="o", markersize=10, markerfacecolor="none", linestyle="",
               color=SOFT, label=TWO_SIGMA),
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside lower center", ncols=3)

# SPDX-License-Identifier: Apache-2.0
"""Figures of a session of interactions; each function turns arrays into a matplotlib Figure."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import NONE
from intent_recognition.report.drawing import (
    DASHED,
    INK,
    PAPER_COLOUR,
    SOFT,
    Look,
    new_axes,
    new_figure,
    readable,
    styled,
    task_colours,
    task_markers,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

SHARE_GRID = np.linspace(0.0, 1.0, 101)


@styled
def hand_error_figure(
    errors_cm: Mapping[str, Sequence[float]],
    paper_cm: Mapping[str, tuple[float, float]] | None = None,
    remarks: Mapping[str, str] | None = None,
    labels: Sequence[str] = (),
) -> "Figure":
    """Every hand error as a dot, their mean +- two standard deviations, and the paper's beside.

    Args:
        errors_cm: per task, (n,) distances in cm.
        paper_cm: per task, mean and two standard deviations in cm.
        remarks: per task, a word below its name.
        labels: of all tasks, also those that did not happen: colours and markers depend on them.
    """
    paper_cm, remarks = paper_cm or {}, remarks or {}
    tasks = {*errors_cm, *labels}
    colours, markers = task_colours(tasks), task_markers(tasks)
    figure, axes = new_axes(5.6, 3.7)
    for place, (task, listed) in enumerate(errors_cm.items()):
        values = np.asarray(listed, dtype=float)
        x = place - 0.12 + _spread(values, 0.1)
        axes.scatter(
            x, values, s=22, color=colours[task], marker=markers[task], alpha=0.55, linewidths=0
        )
        if values.size > 1:
            spread = 2 * values.std(ddof=1)
            _whisker(axes, place + 0.1, values.mean(), spread, colours[task], "ours")
        if task in paper_cm:
            _whisker(axes, place + 0.3, *paper_cm[task], PAPER_COLOUR, "paper", marker="D")
    names = [f"{readable(t)}\n{remarks[t]}" if t in remarks else readable(t) for t in errors_cm]
    axes.set_xticks(range(len(names)), names)
    axes.set(xlim=(-0.5, max(len(names), 1) - 0.4), ylim=(0.0, None))
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("hand error [cm]")
    several = any(len(listed) > 1 for listed in errors_cm.values())
    handles = _mean_handles(several, any(task in paper_cm for task in errors_cm))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


@styled
def decision_share_figure(
    shares: Mapping[str, Sequence[float]], labels: Sequence[str] = ()
) -> "Figure":
    """Histogram per task of the share of the human's movement that had passed at the decision.

    Its colours depend on the labels too, as those of `hand_error_figure`.
    """
    arrays = [np.asarray(values, dtype=float) for values in shares.values()]
    everything = np.concatenate(arrays) if arrays else np.empty(0)
    low, high = everything.min(initial=0.0), everything.max(initial=1.0)
    edges = np.arange(np.floor(20 * low), np.ceil(20 * high) + 1) / 20
    percent = {task: 100 * values for task, values in zip(shares, arrays, strict=True)}
    figure, axes = _histogram(percent, 100 * edges, labels)
    if everything.size:
        _vertical(axes, 100 * np.median(everything), f"median {100 * np.median(everything):.0f} %")
    axes.axvline(100.0, color=INK, linewidth=1.0)
    axes.set_xlabel("share of the human's movement passed at the decision [%]")
    return figure


@styled
def arrival_figure(
    arrivals_s: Mapping[str, Sequence[float]], labels: Sequence[str] = ()
) -> "Figure":
    """Histogram per task of the robot's arrival, counted from the end of the human's movement.

    Its colours depend on the labels too, as those of `hand_error_figure`.
    """
    arrivals = {task: np.asarray(values, dtype=float) for task, values in arrivals_s.items()}
    everything = np.concatenate(list(arrivals.values())) if arrivals else np.zeros(1)
    figure, axes = _histogram(arrivals, np.histogram_bin_edges(everything, bins=20), labels)
    if everything.size:
        _vertical(axes, np.median(everything), f"median {np.median(everything):+.2f} s")
    axes.axvline(0.0, color=INK, linewidth=1.0)
    axes.set_xlabel("robot's arrival after the human's end [s]")
    return figure


@styled
def timing_figure(
    movements_s: Mapping[str, Sequence[float]],
    decisions_s: Mapping[str, Sequence[float]],
    labels: Sequence[str] = (),
) -> "Figure":
    """When it was decided, after onset, over how long the human's movement took, per task.

    Its colours and markers depend on the labels too, as those of `hand_error_figure`.
    """
    tasks = {*movements_s, *labels}
    colours, markers = task_colours(tasks), task_markers(tasks)
    figure, axes = new_axes(5.6, 3.7)
    longest = max((max(v, default=0.0) for v in movements_s.values()), default=0.0) or 1.0
    for share, style in ((1.0, "-"), (0.5, DASHED)):
        axes.plot([0, longest], [0, share * longest], color=SOFT, linewidth=1.1, linestyle=style)
        text = "human's end" if share == 1.0 else "half of it"
        text_look: Look = {"color": SOFT, "fontsize": 8.5, "ha": "right"}
        at = longest, share * longest
        axes.annotate(text, at, (-4, 3), textcoords="offset points", **text_look)
    for task, movement_s in movements_s.items():
        look: Look = {"color": colours[task], "marker": markers[task], "label": readable(task)}
        axes.scatter(movement_s, decisions_s[task], s=24, alpha=0.75, linewidths=0, **look)
    axes.set(xlim=(0, 1.05 * longest), ylim=(0, 1.12 * longest))
    axes.set(xlabel="duration of the human's movement [s]", ylabel="decision after onset [s]")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


@styled
def posterior_figure(
    tasks: Sequence[str],
    labels: Sequence[str],
    shares: Sequence[Floats],
    probabilities: Sequence[Floats],
    decisions: Sequence[float | None] | None = None,
) -> "Figure":
    """Task posteriors over the share of the movement: one panel per true task, a line each.

    Args:
        tasks: true task of each of n interactions.
        labels: of the L columns of the probabilities.
        shares: (T_i,) share of the human's movement at each observation, increasing.
        probabilities: (T_i, L) of each interaction.
        decisions: share at which each was decided, marked by a tick at the top.
    """
    colours = task_colours(labels)
    panels = sorted(set(tasks))
    figure = new_figure(max(5.6, 3.7 * len(panels)), 3.3)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    decisions = decisions or [None] * len(tasks)
    for axes, true in zip(grid, panels, strict=True):
        chosen = [i for i, task in enumerate(tasks) if task == true]
        for column, label in enumerate(labels):
            _bundle(
                axes, [(shares[i], probabilities[i][:, column]) for i in chosen], colours[label]
            )
        decided = [decisions[i] for i in chosen]
        ticks = [100 * share for share in decided if share is not None]
        axes.plot(ticks, np.full(len(ticks), 1.06), "|", color=INK, markersize=7, alpha=0.6)
        axes.set_title(f"true task: {readable(true)} ({len(chosen)})")
        axes.set(xlabel="share of the movement [%]", xlim=(0, 100), ylim=(-0.02, 1.1))
    grid[0].set_ylabel("probability")
    _label_legend(figure, labels, colours)
    return figure


def confusion_counts(
    true: Sequence[str], recognised: Sequence[str]
) -> tuple[list[str], list[str], Floats]:
    """Rows (true tasks), columns (those and what else was recognised, none last) and counts."""
    recognised = [name or NONE for name in recognised]
    rows = sorted(set(true))
    columns = [*sorted((set(recognised) | set(rows)) - {NONE}), NONE]
    counts = np.zeros((len(rows), len(columns)), dtype=int)
    for task, name in zip(true, recognised, strict=True):
        counts[rows.index(task), columns.index(name)] += 1
    return rows, columns, counts


def _bundle(axes: "Axes", lines: Sequence[tuple[Floats, Floats]], colour: str) -> None:
    """Thin lines, and their median; a line that stops early is held."""
    for share, values in lines:
        inside = np.asarray(share) <= 1.0
        x, y = 100 * np.asarray(share)[inside], np.asarray(values)[inside]
        axes.plot(x, y, color=colour, alpha=0.28, linewidth=0.9)
    on_grid = [np.interp(SHARE_GRID, s, v) for s, v in lines if len(s)]
    if on_grid:
        axes.plot(100 * SHARE_GRID, np.median(on_grid, axis=0), color=colour, linewidth=2.4)


def _spread(values: Floats, half_width: float) -> Floats:
    """Offsets that keep dots of a strip apart, the same every time."""
    offsets = np.zeros(values.size)
    pattern = np.array([0.0, 0.5, -0.5, 1.0, -1.0, 0.25, -0.25, 0.75, -0.75])
    offsets[np.argsort(values)] = pattern[np.arange(values.size) % pattern.size]
    return half_width * offsets


def _whisker(
    axes: "Axes", x: float, mean: float, two_std: float, colour: str, label: str, marker: str = "o"
) -> None:
    look: Look = {"color": colour, "markersize": 6.5, "markeredgecolor": "white", "label": label}
    yerr = [[min(two_std, mean)], [two_std]]
    axes.errorbar([x], [mean], yerr=yerr, fmt=marker, capsize=4, elinewidth=1.8, **look)


def _mean_handles(several: bool, with_paper: bool) -> list["Line2D"]:
    from matplotlib.lines import Line2D

    shared: Look = {"linestyle": "-", "markeredgecolor": "white", "markersize": 6.5}
    handles = [
        Line2D([], [], color=SOFT, marker="o", linestyle="", alpha=0.55, label="one interaction")
    ]
    if several:
        text = "ours, mean \N{PLUS-MINUS SIGN} 2 std"
        handles.append(Line2D([], [], color=SOFT, marker="o", label=text, **shared))
    if with_paper:
        text = "paper, mean \N{PLUS-MINUS SIGN} 2 std"
        handles.append(Line2D([], [], color=PAPER_COLOUR, marker="D", label=text, **shared))
    return handles


def _vertical(axes: "Axes", x: float, text: str) -> None:
    axes.axvline(x, color=INK, linewidth=1.3, linestyle=DASHED)
    axes.margins(y=0.12)
    places: Look = {"xycoords": axes.get_xaxis_transform(), "textcoords": "offset points"}
    axes.annotate(text, (x, 1.0), (4, -2), va="top", fontsize=9, **places)


def _histogram(
    values: Mapping[str, Floats], edges: Floats, labels: Sequence[str]
) -> "tuple[Figure, Axes]":
    """How many interactions of each task lie between edges, tasks on top of each other."""
    from matplotlib.ticker import MaxNLocator

    colours = task_colours({*values, *labels})
    figure, axes = new_axes(5.6, 3.7)
    look: Look = {
        "color": [colours[task] for task in values],
        "edgecolor": "white",
        "linewidth": 0.6,
    }
    names = [readable(task) for task in values]
    axes.hist(list(values.values()), bins=list(edges), stacked=True, label=names, **look)
    axes.set_ylabel("interactions")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(visible=False, axis="x")
    figure.legend(loc="outside lower center", ncols=4)
    return figure, axes


def _label_legend(figure: "Figure", labels: Sequence[str], colours: Mapping[str, str]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colours[x], linewidth=2.4, label=readable(x)) for x in labels]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6))

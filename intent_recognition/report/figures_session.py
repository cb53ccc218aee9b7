# SPDX-License-Identifier: Apache-2.0
"""Figures of a session of interactions; each function turns arrays into a matplotlib Figure."""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import (
    DASHED,
    INK,
    PAPER_COLOUR,
    SOFT,
    Drawing,
    Look,
    Panel,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
    task_markers,
)

SHARE_GRID = np.linspace(0.0, 1.0, 101)
MEAN: Look = {"markersize": 6.5, "markeredgecolor": "white"}


@styled
def hand_error_figure(
    errors_cm: Mapping[str, Sequence[float]],
    paper_cm: Mapping[str, tuple[float, float]] | None = None,
    remarks: Mapping[str, str] | None = None,
    labels: Sequence[str] = (),
) -> Drawing:
    """Each hand error as a dot, with mean +- two standard deviations, beside the paper's values.

    Args:
        errors_cm: per task, (n,) distances in cm.
        paper_cm: per task, mean and two standard deviations in cm.
        remarks: per task, a word below its name.
        labels: labels of all tasks, which determine colours and markers.
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
            _whisker(axes, place + 0.1, values.mean(), spread, colours[task])
        if task in paper_cm:
            _whisker(axes, place + 0.3, *paper_cm[task], PAPER_COLOUR, marker="D")
    names = [f"{readable(t)}\n{remarks[t]}" if t in remarks else readable(t) for t in errors_cm]
    axes.set_xticks(range(len(names)), names)
    axes.set(xlim=(-0.5, max(len(names), 1) - 0.4), ylim=(0.0, None))
    axes.grid(visible=False, axis="x")
    axes.set_ylabel("hand error [cm]")
    axes.plot([], [], "o", color=SOFT, alpha=0.55, label="one interaction", **MEAN)
    spread = "mean \N{PLUS-MINUS SIGN} 2 std"
    if any(len(listed) > 1 for listed in errors_cm.values()):
        axes.plot([], [], "o-", color=SOFT, label=f"ours, {spread}", **MEAN)
    if any(task in paper_cm for task in errors_cm):
        axes.plot([], [], "D-", color=PAPER_COLOUR, label=f"paper, {spread}", **MEAN)
    figure.legend(loc="outside lower center", ncols=3)
    return figure


@styled
def histogram_figure(
    values: Mapping[str, Sequence[float]],
    what: str,
    end: float,
    form: str,
    labels: Sequence[str] = (),
) -> Drawing:
    """Stacked histogram of values by task, with the median of all values.

    Args:
        values: per task, (n,).
        what: name of the quantity, with its unit.
        end: value of the end of the human's movement, drawn as a line.
        form: format of the median, for `str.format`.
        labels: labels of all tasks, as in `hand_error_figure`.
    """
    from matplotlib.ticker import MaxNLocator

    everything = np.concatenate([[], *values.values()])
    colours = task_colours({*values, *labels})
    figure, axes = new_axes(5.6, 3.7)
    look: Look = {"edgecolor": "white", "linewidth": 0.6, "stacked": True}
    look |= {"color": [colours[task] for task in values], "label": [*map(readable, values)]}
    edges = np.histogram_bin_edges(np.append(everything, end), bins=30)  # also with equal values
    axes.hist(list(values.values()), bins=list(edges), **look)
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.grid(visible=False, axis="x")
    axes.set(xlabel=what, ylabel="interactions")
    figure.legend(loc="outside lower center", ncols=4)
    if everything.size:
        middle = float(np.median(everything))
        axes.axvline(middle, color=INK, linewidth=1.3, linestyle=DASHED)
        axes.margins(y=0.12)
        places: Look = {"xycoords": axes.get_xaxis_transform(), "textcoords": "offset points"}
        places["bbox"] = {"color": "white", "pad": 1}  # over the line of the end
        text = f"median {form.format(middle)}"
        axes.annotate(text, (middle, 1.0), (4, -2), va="top", fontsize=9, **places)
    axes.axvline(end, color=INK, linewidth=1.0)
    return figure


@styled
def posterior_figure(
    tasks: Sequence[str],
    labels: Sequence[str],
    shares: Sequence[Floats],
    probabilities: Sequence[Floats],
    decisions: Sequence[float | None],
) -> Drawing:
    """Task posteriors over the share of the movement: panels by true task, a line per interaction.

    Args:
        tasks: true task of each of n interactions.
        labels: labels of the L columns of the probabilities.
        shares: (T_i,) share of the human's movement at each observation, increasing.
        probabilities: (T_i, L) posteriors of each interaction.
        decisions: share at the decision of each interaction, marked by a tick at the top.
    """
    colours = task_colours(labels)
    panels = sorted(set(tasks))
    figure = new_figure(max(5.6, 3.7 * len(panels)), 3.3)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, true in zip(grid, panels, strict=True):
        chosen = [i for i, task in enumerate(tasks) if task == true]
        for column, label in enumerate(labels):
            lines = [(shares[i], probabilities[i][:, column]) for i in chosen]
            _bundle(axes, lines, colours[label], readable(label))
        decided = [decisions[i] for i in chosen]
        ticks = [100 * share for share in decided if share is not None]
        axes.plot(ticks, np.full(len(ticks), 1.06), "|", color=INK, markersize=7, alpha=0.6)
        axes.set_title(f"true task: {readable(true)} ({len(chosen)})")
        axes.set(xlabel="share of the movement [%]", xlim=(0, 100), ylim=(-0.02, 1.1))
    grid[0].set_ylabel("probability")
    shared_legend(figure, grid, 6)
    return figure


def _bundle(axes: Panel, lines: Sequence[tuple[Floats, Floats]], colour: str, name: str) -> None:
    """Draw thin lines and their median; a line that ends early is held at its last value."""
    for share, values in lines:
        inside = np.asarray(share) <= 1.0
        x, y = 100 * np.asarray(share)[inside], np.asarray(values)[inside]
        axes.plot(x, y, color=colour, alpha=0.28, linewidth=0.9)
    on_grid = [np.interp(SHARE_GRID, s, v) for s, v in lines if len(s)]
    if on_grid:
        median = np.median(on_grid, axis=0)
        axes.plot(100 * SHARE_GRID, median, color=colour, linewidth=2.4, label=name)


def _spread(values: Floats, half_width: float) -> Floats:
    """Horizontal offsets that separate the dots of a strip; equal input gives equal offsets."""
    offsets = np.zeros(values.size)
    pattern = np.array([0.0, 0.5, -0.5, 1.0, -1.0, 0.25, -0.25, 0.75, -0.75])
    offsets[np.argsort(values)] = pattern[np.arange(values.size) % pattern.size]
    return half_width * offsets


def _whisker(
    axes: Panel, x: float, mean: float, two_std: float, colour: str, marker: str = "o"
) -> None:
    look: Look = {"color": colour, "fmt": marker, "capsize": 4, "elinewidth": 1.8, **MEAN}
    axes.errorbar([x], [mean], yerr=[[min(two_std, mean)], [two_std]], **look)

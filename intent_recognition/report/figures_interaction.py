# SPDX-License-Identifier: Apache-2.0
"""One interaction in detail: the wrist's path and the joints, predicted and measured."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import (
    INK,
    PREDICTED_COLOUR,
    SOFT,
    Look,
    fill_two_sigma,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OBSERVED, PREDICTED, TUBE = INK, PREDICTED_COLOUR, "#f5dfe5"
PREDICTED_LINE, DOTTED = (0, (4, 1.6)), (0, (1, 1.5))


@styled
def wrist_figure(trace: Mapping) -> "Figure":
    """The wrist's path seen from above and from the side; keys as in `evaluation.Trace`."""
    figure = new_figure(5.6, 3.9)
    grid = figure.subplots(1, 2)
    observed = thin(np.asarray(trace["wrist_m"], dtype=float))
    predicted = trace.get("predicted_wrist_m")
    for axes, (i, j), title in zip(grid, ((0, 1), (0, 2)), ("from above", "side"), strict=True):
        axes.plot(observed[:, i], observed[:, j], color=OBSERVED, label="observed")
        axes.plot(*observed[0, [i, j]], "o", color=OBSERVED, markersize=5)
        if predicted is not None:
            path = np.asarray(predicted, dtype=float)
            _tube(axes, path[:, [i, j]], trace.get("predicted_wrist_std_m"), (i, j))
            line: Look = {"color": PREDICTED, "linestyle": PREDICTED_LINE, "label": "predicted"}
            axes.plot(path[:, i], path[:, j], **line)
        axes.set(title=title, xlabel="x [m]", ylabel=f"{'xyz'[j]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.locator_params(nbins=5)
    shared_legend(figure, grid[:1], 2)
    return figure


@styled
def transfer_figure(trace: Mapping) -> "Figure":
    """Forces while an object changes hands; keys as in `evaluation.Trace`."""
    figure = new_figure(11.2, 4.2)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    felt_s = np.asarray(trace["transfer_s"], dtype=float)
    load: Look = {"color": PREDICTED, "linewidth": 0.8, "alpha": 0.6}
    axes.plot(felt_s, trace["load_n"], **load, label="load that the robot feels")
    axes.plot(felt_s, trace["grip_n"], color=SOFT, label="each finger")
    axes.plot(trace["person_s"], trace["person_n"], color=OBSERVED, label="person, in truth")
    axes.set(ylabel="force [N]")
    below.fill_between(felt_s, 100.0 * np.asarray(trace["load_share"], dtype=float), color=TUBE)
    below.set(xlabel="time after onset [s]", ylabel="share [%]", ylim=(0, 100), yticks=(0, 50, 100))
    shared_legend(figure, [axes], 3)
    return figure


@styled
def joint_figure(trace: Mapping) -> "Figure":
    """Each joint: predicted mean +- 2 sigma at the decision, and as measured."""
    keys = ("joint_s", "joint_rad", "predicted_s", "predicted_rad", "predicted_std_rad")
    arrays = (np.asarray(trace[k] if trace.get(k) is not None else (), dtype=float) for k in keys)
    measured_s, measured, predicted_s, mean, std = arrays
    count = (mean if mean.size else measured).shape[1]
    names = trace.get("joint_names")
    if names is None:
        names = [f"joint {i + 1}" for i in range(count)]
    columns = min(count, 4)
    rows = -(-count // columns)
    figure = new_figure(11.2, 0.6 + 2.1 * rows)
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for joint, axes in enumerate(grid[:count]):
        if mean.size:
            predicted: Look = {"color": PREDICTED, "linestyle": PREDICTED_LINE}
            axes.plot(predicted_s, mean[:, joint], label="predicted at the decision", **predicted)
        if mean.size and std.size:
            spread, label = std[:, joint], "\N{PLUS-MINUS SIGN}2 std"
            fill_two_sigma(axes, predicted_s, mean[:, joint], spread, PREDICTED, label=label)
        if measured.size:
            shown = thin(measured)[:, joint]
            axes.plot(thin(measured_s), shown, color=OBSERVED, label="measured")
        _events(axes, trace)
        axes.set_title(readable(names[joint]))
    for axes in grid[count:]:
        axes.set_axis_off()
    for axes in grid[max(count - columns, 0) : count]:
        axes.set_xlabel("time after onset [s]")
        axes.tick_params(labelbottom=True)
    for axes in grid[:count:columns]:
        axes.set_ylabel("angle [rad]")
    if count < len(grid):
        free: Any = grid[count]
        free.legend(*grid[0].get_legend_handles_labels(), loc="center left")
    else:
        shared_legend(figure, grid[:1], 5)
    return figure


@styled
def posterior_over_time_figure(trace: Mapping, movement_s: float) -> "Figure":
    """One interaction's task posterior over time, with its decision and the human's end."""
    colours = task_colours(trace["labels"])
    time_s = thin(np.asarray(trace["share"], dtype=float)) * movement_s
    probabilities = thin(np.asarray(trace["probabilities"], dtype=float))
    figure, axes = new_axes(5.6, 3.9)
    lines = [
        axes.plot(time_s, p, color=colours[label], label=readable(label))[0]
        for label, p in zip(trace["labels"], probabilities.T, strict=True)
    ]
    _events(axes, {"end_s": movement_s, **trace})
    axes.set(ylim=(-0.02, 1.04), xlabel="time after onset [s]", ylabel="probability")
    figure.legend(handles=lines, loc="outside lower center", ncols=5)
    return figure


def thin(values: Floats, count: int = 400) -> Floats:
    """At most `count` rows, evenly spaced, first and last kept."""
    if len(values) <= count:
        return values
    return values[np.linspace(0, len(values) - 1, count).round().astype(int)]


def _tube(axes: "Axes", path: Floats, std: Floats | None, dofs: tuple[int, int]) -> None:
    """Ellipses of two standard deviations along a path, (L, 2)."""
    if std is None:
        return
    from matplotlib.collections import EllipseCollection

    size = 4 * np.asarray(std, dtype=float)[:, list(dofs)]
    axes.update_datalim(np.concatenate([path - size / 2, path + size / 2]))
    at = np.linspace(0, len(path) - 1, min(len(path), 40)).round().astype(int)
    look: Look = {"facecolors": TUBE, "linewidths": 0, "zorder": 1.5}
    places: Look = {"units": "xy", "offsets": path[at], "offset_transform": axes.transData}
    widths, heights = size[at].T
    ellipses = EllipseCollection(widths, heights, np.zeros(at.size), **places, **look)
    axes.add_collection(ellipses)


def _events(axes: "Axes", trace: Mapping) -> None:
    for key, label, line in (("decision_s", "decision", "-"), ("end_s", "human's end", DOTTED)):
        if trace.get(key) is not None:
            axes.axvline(trace[key], color=SOFT, linewidth=1.2, linestyle=line, label=label)

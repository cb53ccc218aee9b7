# SPDX-License-Identifier: Apache-2.0
"""One interaction in detail: the wrist's path and the joints, predicted and measured."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import (
    INK,
    PREDICTED_COLOUR,
    SOFT,
    fill_two_sigma,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OBSERVED, PREDICTED, TUBE = INK, PREDICTED_COLOUR, "#f5dfe5"


@styled
def wrist_figure(trace: Mapping) -> "Figure":
    """The wrist's path seen from above and from the side; keys as in `traces.Trace`."""
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
            axes.plot(
                path[:, i], path[:, j], color=PREDICTED, linestyle=(0, (4, 1.6)), label="predicted"
            )
        axes.set(title=title, xlabel="x [m]", ylabel=f"{'xyz'[j]} [m]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.locator_params(nbins=5)
    shared_legend(figure, grid[:1], 2)
    return figure


@styled
def transfer_figure(trace: Mapping) -> "Figure":
    """Forces while an object changes hands; keys as in `traces.Trace`."""
    figure = new_figure(11.2, 4.2)
    axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    felt_s = np.asarray(trace["transfer_s"], dtype=float)
    load = {"color": PREDICTED, "linewidth": 0.8, "alpha": 0.6}
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
    measured_s = np.asarray(trace.get("joint_s", ()), dtype=float)
    measured = np.asarray(trace.get("joint_rad", ()), dtype=float)
    predicted_s = np.asarray(trace.get("predicted_s", ()), dtype=float)
    mean = np.asarray(trace.get("predicted_rad", ()), dtype=float)
    std = trace.get("predicted_std_rad")
    count = (mean if mean.size else measured).shape[1]
    names = trace.get("joint_names")
    if names is None:
        names = [f"joint {i + 1}" for i in range(count)]
    columns = 4 if count > 3 else count
    rows = -(-count // columns)
    figure = new_figure(11.2, 0.6 + 2.1 * rows, _margins(rows, count == columns * rows))
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for joint, axes in enumerate(grid[:count]):
        if std is not None and mean.size:
            spread = np.asarray(std, dtype=float)[:, joint]
            fill_two_sigma(axes, predicted_s, mean[:, joint], spread, PREDICTED, alpha=0.2)
        if mean.size:
            axes.plot(predicted_s, mean[:, joint], color=PREDICTED, linestyle=(0, (4, 1.6)))
        if measured.size:
            axes.plot(thin(measured_s), thin(measured)[:, joint], color=OBSERVED)
        _events(axes, trace)
        axes.set_title(readable(names[joint]))
    for axes in grid[count:]:
        axes.set_axis_off()
    for axes in grid[max(count - columns, 0) : count]:
        axes.set_xlabel("time after onset [s]")
        axes.tick_params(labelbottom=True)
    for axes in grid[:count:columns]:
        axes.set_ylabel("angle [rad]")
    _legend(figure, grid, count, std is not None and mean.size > 0, trace)
    return figure


@styled
def posterior_over_time_figure(trace: Mapping, movement_s: float) -> "Figure":
    """One interaction's task posterior over time, with its decision and the human's end."""
    colours = task_colours(trace["labels"])
    time_s = thin(np.asarray(trace["share"], dtype=float)) * movement_s
    probabilities = thin(np.asarray(trace["probabilities"], dtype=float))
    figure, axes = new_axes(5.6, 3.9)
    for column, label in enumerate(trace["labels"]):
        axes.plot(time_s, probabilities[:, column], color=colours[label], label=readable(label))
    _events(axes, {"end_s": movement_s, **trace})
    axes.set(ylim=(-0.02, 1.04), xlabel="time after onset [s]", ylabel="probability")
    figure.legend(loc="outside lower center", ncols=5)
    return figure


def _margins(rows: int, legend_below: bool) -> dict[str, float]:
    height_in = 0.6 + 2.1 * rows
    return {
        "left": 0.055,
        "right": 0.995,
        "top": 1 - 0.3 / height_in,
        "bottom": (0.85 if legend_below else 0.5) / height_in,
        "wspace": 0.24,
        "hspace": 0.42,
    }


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
    axes.add_collection(
        EllipseCollection(
            size[at, 0],
            size[at, 1],
            np.zeros(at.size),
            units="xy",
            offsets=path[at],
            offset_transform=axes.transData,
            facecolors=TUBE,
            linewidths=0,
            zorder=1.5,
        )
    )


def _events(axes: "Axes", trace: Mapping) -> None:
    if trace.get("decision_s") is not None:
        axes.axvline(trace["decision_s"], color=SOFT, linewidth=1.2)
    if trace.get("end_s") is not None:
        axes.axvline(trace["end_s"], color=SOFT, linewidth=1.2, linestyle=(0, (1, 1.5)))


def _legend(
    figure: "Figure", grid: NDArray[np.object_], count: int, with_band: bool, trace: Mapping
) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Artist] = [
        Line2D([], [], color=OBSERVED, label="measured"),
        Line2D([], [], color=PREDICTED, linestyle=(0, (4, 1.6)), label="predicted at the decision"),
    ]
    if with_band:
        handles.append(
            Patch(color=PREDICTED, alpha=0.2, linewidth=0, label="\N{PLUS-MINUS SIGN}2 std")
        )
    if trace.get("decision_s") is not None:
        handles.append(Line2D([], [], color=SOFT, linewidth=1.2, label="decision"))
    if trace.get("end_s") is not None:
        handles.append(
            Line2D([], [], color=SOFT, linewidth=1.2, linestyle=(0, (1, 1.5)), label="human's end")
        )
    if count < len(grid):
        grid[count].legend(handles=handles, loc="center left")
    else:
        figure.legend(handles=handles, loc="lower center", ncols=len(handles))

# SPDX-License-Identifier: Apache-2.0
"""Figures of one interaction: its posterior over time, and the forces of its transfer."""

from collections.abc import Mapping

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import (
    INK,
    PREDICTED_COLOUR,
    SOFT,
    Drawing,
    Look,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
    task_colours,
)

POSTERIOR = "Task posterior; solid vertical line: decision; dotted: end of the movement."
OBSERVED, PREDICTED, TUBE = INK, PREDICTED_COLOUR, "#f5dfe5"


@styled
def transfer_figure(trace: Mapping) -> Drawing:
    """Forces while an object changes hands; keys are those of `evaluation.Trace`."""
    share = 100.0 * np.asarray(trace["load_share"], dtype=float)
    heights = (3, 1) if share.any() else (3,)  # a robot that takes an object measures no share
    figure = new_figure(11.2, 1.05 * sum(heights))
    grid = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)
    axes, *lower = grid[:, 0]
    felt_s = np.asarray(trace["transfer_s"], dtype=float)
    load: Look = {"color": PREDICTED, "linewidth": 0.8, "alpha": 0.6}
    axes.plot(felt_s, trace["load_n"], **load, label="load that the robot feels")
    axes.plot(felt_s, trace["grip_n"], color=SOFT, label="each finger")
    axes.plot(trace["person_s"], trace["person_n"], color=OBSERVED, label="person, true force")
    axes.set(ylabel="force [N]")
    for below in lower:
        below.fill_between(felt_s, share, color=TUBE)
        below.set(ylabel="share [%]", ylim=(0, 100), yticks=(0, 50, 100))
    grid[-1, 0].set_xlabel("time after onset [s]")
    shared_legend(figure, [axes], 3)
    return figure


@styled
def posterior_over_time_figure(trace: Mapping, movement_s: float) -> Drawing:
    """Task posterior of one interaction over time, with its decision and the movement's end."""
    colours = task_colours(trace["labels"])
    time_s = thin(np.asarray(trace["share"], dtype=float)) * movement_s
    probabilities = thin(np.asarray(trace["probabilities"], dtype=float))
    figure, axes = new_axes(5.6, 3.9)
    lines = [
        axes.plot(time_s, p, color=colours[label], label=readable(label))[0]
        for label, p in zip(trace["labels"], probabilities.T, strict=True)
    ]
    events = (trace.get("decision_s"), "-"), (trace.get("end_s", movement_s), ":")
    for at_s, line in events:
        if at_s is not None:
            axes.axvline(at_s, color=SOFT, linewidth=1.2, linestyle=line)
    axes.set(ylim=(-0.02, 1.04), xlabel="time after onset [s]", ylabel="probability")
    figure.legend(handles=lines, loc="outside lower center", ncols=5)
    return figure


def thin(values: Floats, count: int = 400) -> Floats:
    """At most `count` rows, evenly spaced, including the first and the last."""
    if len(values) <= count:
        return values
    return values[np.linspace(0, len(values) - 1, count).round().astype(int)]

# SPDX-License-Identifier: Apache-2.0
"""Figures of an evaluation on held-out recordings."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers
from intent_recognition.report.drawing import (
    DASHED,
    INK,
    PALETTE,
    SOFT,
    Drawing,
    Look,
    Panel,
    new_axes,
    new_figure,
    readable,
    shared_legend,
    styled,
)

PHASE_NAMES = {"known_phase": "known phase", "unknown_phase": "unknown phase"}
PHASE_STYLES: dict[str, dict[str, Any]] = {
    "known_phase": {"color": PALETTE[0], "marker": "o", "markeredgecolor": "white"},
    "unknown_phase": {"color": PALETTE[1], "marker": "s", "ls": DASHED, "markerfacecolor": "none"},
}
"""Style of each kind of phase; the second, often as accurate, does not hide the first."""
RMSE_STYLES: dict[str, tuple[str, str, str, Any]] = {
    "rmse": ("library, true task", PALETTE[0], "o", "-"),
    "rmse_inferred_task": ("library, inferred task", PALETTE[5], "s", (0, (1, 1.5))),
    "rmse_future": ("library, part not yet seen", PALETTE[2], "^", "-"),
    "rmse_mean_of_task": ("mean of the task", PALETTE[1], "D", (0, (4, 1.6))),
    "rmse_nearest_neighbour": ("nearest neighbour", PALETTE[3], "v", (0, (4, 1.6))),
}
TWO_SIGMA = 0.9545
"""Probability of the interval within two standard deviations of a normal distribution."""

ScoreValues = Sequence[float] | Floats
Series = Mapping[str, tuple[ScoreValues, ScoreValues]]
"""By name, fractions observed (F,) and values (F,); NaN values are not drawn."""


@styled
def recognition_figure(accuracy: Series, log_loss: Series, segment: str = "movement") -> Drawing:
    """Accuracy and log loss over the observed share, with known and with unknown phase."""
    figure = new_figure(11.2, 3.5)
    left, right = figure.subplots(1, 2)
    _phases(left, accuracy, segment)
    left.set(ylabel="accuracy", ylim=(min(0.5, _lowest(accuracy) - 0.05), 1.02))
    _phases(right, log_loss, segment)
    right.set(ylabel="log loss [nat]", ylim=(0.0, None))
    shared_legend(figure, [left], 2)
    return figure


@styled
def rmse_figure(panels: Mapping[str, Series], unit: str, segment: str = "movement") -> Drawing:
    """Error of the controlled agent beside the baselines, one panel per kind of phase."""
    figure = new_figure(11.2, 3.9)
    grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for axes, (phase, series) in zip(grid, panels.items(), strict=True):
        for name, (fractions, values) in series.items():
            label, colour, marker, line = RMSE_STYLES[name]
            percent = 100 * np.asarray(fractions, dtype=float)
            style = {"linestyle": line, "markersize": 5.5, "markeredgecolor": "white"}
            numbers = np.asarray(values, dtype=float)
            axes.plot(percent, numbers, label=label, color=colour, marker=marker, **style)
        axes.set_title(PHASE_NAMES[phase])
        axes.set_xlabel(_observed(segment))
        axes.margins(y=0.12)
    grid[0].set_ylabel(f"RMSE [{unit}]")
    shared_legend(figure, grid[:1], len(RMSE_STYLES))
    return figure


@styled
def coverage_figure(coverage: Series, segment: str = "movement") -> Drawing:
    """Share of true values within +-2 sigma; the ideal is 95 %."""
    figure, axes = new_axes(5.6, 3.7)
    axes.axhline(100 * TWO_SIGMA, color=INK, linewidth=1.2, linestyle=DASHED)
    look: Look = {"color": SOFT, "fontsize": 8.5, "transform": axes.get_yaxis_transform()}
    axes.text(0.01, 100 * TWO_SIGMA + 0.8, "95.4 % is right", **look)
    percent = {name: (f, 100 * np.asarray(v, float)) for name, (f, v) in coverage.items()}
    _phases(axes, percent, segment)
    lowest = min(80.0, 100 * _lowest(coverage) - 5)
    axes.set(ylim=(lowest, 102), ylabel="inside \N{PLUS-MINUS SIGN}2 sigma [%]")
    axes.legend(loc="lower right")
    return figure


@styled
def reliability_figure(confidence: Floats, share_right: Floats, counts: Integers) -> Drawing:
    """How often a task was true (B,) when its probability was about `confidence` (B,).

    Args:
        confidence: mean probability per bin; NaN for an empty bin.
        share_right: share of true tasks per bin.
        counts: number of probabilities per bin, drawn as the area of the dots.
    """
    counts = np.asarray(counts, dtype=float)
    figure, axes = new_axes(5.6, 3.7)
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=1.2, linestyle=DASHED, label="calibrated")
    used = counts > 0
    x, y = np.asarray(confidence)[used], np.asarray(share_right)[used]
    area = 18 + 130 * np.sqrt(counts[used] / max(counts.max(initial=1.0), 1.0))
    axes.plot(x, y, color=PALETTE[0], linewidth=1.2, alpha=0.6)
    look: Look = {"color": PALETTE[0], "edgecolor": "white", "label": "observed (area: how many)"}
    axes.scatter(x, y, s=area, zorder=3, **look)
    axes.set(xlabel="probability given to a task", ylabel="share of cases in which it was true")
    axes.set(xlim=(-0.04, 1.04), ylim=(-0.04, 1.04))
    figure.legend(loc="outside upper center", ncols=2, markerscale=0.6)  # points fill the axes
    return figure


@styled
def confusion_shares_figure(
    counts: ArrayLike, true: Sequence[str], recognised: Sequence[str]
) -> Drawing:
    """Confusion matrix: true tasks (rows) and recognised tasks (columns), as shares of the row.

    `counts` are (K, K + 1), with the names of rows and columns; the last column is `none`.
    """
    counts = np.asarray(counts, dtype=float)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    n_rows, n_columns = counts.shape
    figure, axes = new_axes(2.3 + 0.62 * n_columns, 1.3 + 0.42 * n_rows)
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.15, aspect="auto")
    if n_columns <= 16:
        for row in range(n_rows):
            for column in np.flatnonzero(counts[row]):
                colour = "white" if share[row, column] > 0.6 else INK
                text = f"{counts[row, column]:.0f}"
                axes.text(float(column), row, text, ha="center", va="center", color=colour)
    axes.set_xticks(range(n_columns), [readable(name) for name in recognised])
    axes.set_xticks(np.arange(n_columns - 1) + 0.5, minor=True)
    axes.set_yticks(range(n_rows), [readable(name) for name in true])
    axes.tick_params(axis="x", rotation=30, length=0)
    axes.tick_params(axis="y", length=0)
    for label in axes.get_xticklabels():
        label.set_horizontalalignment("right")
        label.set_rotation_mode("anchor")
    axes.grid(False)
    axes.axvline(n_columns - 1.5, color=SOFT, linewidth=1.0)
    axes.set(xlabel="recognised as", ylabel="true task")
    return figure


@styled
def roc_figure(unknown: Sequence[float], known: Sequence[float], area: float) -> Drawing:
    """Share of known over share of unknown movements that reach each threshold, as steps."""
    figure, axes = new_axes(5.0, 3.9)
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=1.2, linestyle=DASHED, label="chance")
    axes.plot(unknown, known, color=PALETTE[0], label=f"area {area:.3f}")
    axes.fill_between(unknown, known, color=PALETTE[0], alpha=0.08, linewidth=0)
    axes.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.03))
    axes.set(xlabel="share of unknown movements", ylabel="share of known movements")
    axes.legend(loc="lower right")
    return figure


def _phases(axes: Panel, series: Series, segment: str) -> None:
    for phase, (fractions, values) in series.items():
        percent, numbers = 100 * np.asarray(fractions, dtype=float), np.asarray(values, dtype=float)
        look = {"markersize": 5.5, "clip_on": False, "zorder": 3}  # not clipped at the axes
        axes.plot(percent, numbers, label=PHASE_NAMES[phase], **(look | PHASE_STYLES[phase]))
    axes.set(xlabel=_observed(segment), xlim=(0, 103))


def _observed(segment: str) -> str:
    return f"share of the {segment} observed [%]"


def _lowest(series: Series) -> float:
    values = np.concatenate([np.asarray(v, dtype=float) for _, v in series.values()])
    finite = values[np.isfinite(values)]
    return float(finite.min(initial=1.0))

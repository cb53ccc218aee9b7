# SPDX-License-Identifier: Apache-2.0
"""Calibration figures: confidence regions, confusion matrices, ROC of unknown movements."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.report.drawing import DASHED, INK, PALETTE, SOFT, new_axes, readable, styled
from intent_recognition.report.figures_evaluation import draw_phase

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def regions_figure(regions: Mapping[str, tuple[Sequence[float], Sequence[float]]]) -> "Figure":
    """Share of true values inside regions, against the share that they should hold.

    Args:
        regions: per phase knowledge, shares that should (L,) and that do (L,) lie inside.
    """
    figure, axes = new_axes(5.6, 3.7)
    axes.plot([0.4, 1], [0.4, 1], color=SOFT, linewidth=1.2, linestyle=DASHED)
    for phase, (should, does) in regions.items():
        draw_phase(axes, phase, should, does)
    lowest = min((min(does) for _, does in regions.values()), default=0.5)
    axes.set_xlim(0.45, 1.02)
    axes.set_ylim(min(0.45, lowest - 0.03), 1.02)
    axes.set_xlabel("share that the region should hold")
    axes.set_ylabel("share of true values inside")
    axes.legend(loc="lower right")
    return figure


@styled
def confusion_shares_figure(
    counts: Floats, true: Sequence[str], recognised: Sequence[str]
) -> "Figure":
    """How often each task (rows) was taken for which (columns), as shares of the row.

    Args:
        counts: (K, K + 1).
        true: names of the rows.
        recognised: names of the columns, none the last.
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
def roc_figure(unknown: Sequence[float], known: Sequence[float], area: float) -> "Figure":
    """Share of known against share of unknown movements that reach each threshold, as steps."""
    figure, axes = new_axes(5.0, 3.9)
    axes.plot([0, 1], [0, 1], color=SOFT, linewidth=1.2, linestyle=DASHED, label="chance")
    axes.plot(unknown, known, color=PALETTE[0], label=f"area {area:.3f}")
    axes.fill_between(unknown, known, color=PALETTE[0], alpha=0.08, linewidth=0)
    axes.set_xlim(-0.02, 1.02)
    axes.set_ylim(-0.02, 1.03)
    axes.set_xlabel("share of unknown movements")
    axes.set_ylabel("share of known movements")
    axes.legend(loc="lower right")
    return figure

# SPDX-License-Identifier: Apache-2.0
"""Figures of the moved box: where everybody goes, and what knowing its place brings."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from intent_recognition.report import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    Drawing,
    new_axes,
    new_figure,
    shared_legend,
    styled,
)

STYLES = ((NONE_COLOUR, "-"), (PALETTE[1], "-"), (PALETTE[2], DASHED), (PALETTE[0], "-"))
"""Colour and line of each condition."""


@styled
def scene_figure(
    courses: Sequence[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]],
    turns_at: int,
) -> Drawing:
    """Wrist and hand from above, at some places of the box.

    Args:
        courses: box (2,), wrist (T, 3) and hand (T, 3) of each place [m].
        turns_at: number of the sample from which on the wrist turns to the box.
    """
    figure, axes = new_axes(5.4, 4.2)
    for colour, (box, wrist, hand) in zip(PALETTE, courses, strict=False):
        axes.plot(*wrist[:, :2].T, color=colour, label="wrist")
        axes.plot(*hand[:, :2].T, color=colour, linestyle=DASHED, label="robot's hand")
        axes.plot(*box, marker="s", markersize=9, color=colour, linestyle="none", label="box")
    _, wrist, _ = courses[0]
    axes.plot(
        *wrist[turns_at, :2], marker="o", color=INK, linestyle="none", label="the wrist turns"
    )
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="datalim")
    shared_legend(figure, [axes], 4)
    return figure


@styled
def outcome_figure(
    shares: Sequence[float],
    errors_m: Mapping[str, NDArray[np.float64]],
    decided: Mapping[str, NDArray[np.float64]],
    turns_at: float,
) -> Drawing:
    """Error of the predicted end over the share seen, and when the task was acted on.

    Args:
        shares: of the movement that were seen, (k,).
        errors_m: mean error of each draw, by condition, (draws, k) [m].
        decided: share of the movement at each decision, by condition, NaN for none, (n,).
        turns_at: share of the movement from which on the wrist turns to the box.
    """
    figure = new_figure(8.6, 3.6)
    left, right = figure.subplots(1, 2)
    for (colour, line), (name, drawn) in zip(STYLES, errors_m.items(), strict=True):
        percent, centimetres = 100.0 * np.asarray(shares), 100.0 * drawn
        left.fill_between(
            percent, centimetres.min(0), centimetres.max(0), color=colour, alpha=0.15, lw=0
        )
        left.plot(
            percent, centimetres.mean(0), color=colour, linestyle=line, marker="o", label=name
        )
        times = np.sort(decided[name][np.isfinite(decided[name])])
        share = 100.0 * np.arange(len(times) + 1) / len(decided[name])
        right.step(100.0 * np.r_[0.0, times], share, where="post", color=colour, linestyle=line)
    for axes in (left, right):
        axes.axvline(100.0 * turns_at, color=INK, lw=1.0, linestyle=DASHED)
        axes.set(xlabel="movement passed [%]", xlim=(0.0, 82.0), ylim=(0.0, None))
    left.set_ylabel("error of the hand's predicted end [cm]")
    right.set_ylabel("acted on [%]")
    shared_legend(figure, [left], 4)
    return figure

# SPDX-License-Identifier: Apache-2.0
"""The figure of the moved box: what knowing its place brings."""

from collections.abc import Mapping, Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.report import (
    DASHED,
    INK,
    NONE_COLOUR,
    PALETTE,
    Drawing,
    new_figure,
    shared_legend,
    styled,
)

STYLES = ((NONE_COLOUR, "-"), (PALETTE[1], "-"), (PALETTE[2], DASHED), (PALETTE[0], "-"))
"""Colour and line of each condition."""


@styled
def outcome_figure(
    shares: Sequence[float],
    errors_m: Mapping[str, Floats],
    decided: Mapping[str, Floats],
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

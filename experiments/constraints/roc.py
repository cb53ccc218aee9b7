# SPDX-License-Identifier: Apache-2.0
"""Receiver operating characteristic: true against false positives over all thresholds."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats

GRID = np.linspace(0.0, 1.0, 201)
"""False positive rates at which curves are averaged."""


class RocCurve(NamedTuple):
    """One curve.

    Attributes:
        false_positive: share of the negatives that are called positive, ascending (k,).
        true_positive: share of the positives found (k,).
        area: below the curve: how often a positive scores above a negative, ties counted half.
    """

    false_positive: Floats
    true_positive: Floats
    area: float


def roc_curve(scores: Floats, labels: Floats) -> RocCurve:
    """The curve of scores (n,), higher for positives, against labels (n,), 0 or 1."""
    positive = np.asarray(labels, dtype=bool)
    order = np.argsort(-np.asarray(scores, dtype=float), kind="stable")
    ranked = np.asarray(scores, dtype=float)[order]
    last = np.append(np.flatnonzero(np.diff(ranked)), len(ranked) - 1)
    found = np.cumsum(positive[order])[last] / positive.sum()
    alarms = np.cumsum(~positive[order])[last] / (~positive).sum()
    false_positive, true_positive = np.append(0.0, alarms), np.append(0.0, found)
    height = 0.5 * (true_positive[1:] + true_positive[:-1])
    area = float(np.sum(height * np.diff(false_positive)))
    return RocCurve(false_positive, true_positive, area)


def on_grid(curve: RocCurve, grid: Floats = GRID) -> Floats:
    """True positive rate at given false positive rates; the upper one where the curve is steep."""
    low = np.searchsorted(curve.false_positive, grid, side="right") - 1
    high = np.minimum(low + 1, len(curve.false_positive) - 1)
    step = curve.false_positive[high] - curve.false_positive[low]
    share = np.divide(
        grid - curve.false_positive[low], step, out=np.zeros_like(grid), where=step > 0.0
    )
    return curve.true_positive[low] + share * (curve.true_positive[high] - curve.true_positive[low])

# SPDX-License-Identifier: Apache-2.0
"""ROC curves against counting pairs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.constraints.roc import GRID, on_grid, roc_curve
from intent_recognition.errors import ArgumentError

SAMPLES = st.lists(st.tuples(st.integers(-3, 3), st.booleans()), min_size=2, max_size=40).filter(
    lambda rows: len({label for _, label in rows}) == 2
)


@given(SAMPLES)
def test_area_is_how_often_a_positive_scores_higher(rows):
    scores, labels = (np.array(column) for column in zip(*rows, strict=True))
    pairs = scores[labels][:, None] - scores[~labels][None]
    expected = np.mean((pairs > 0) + 0.5 * (pairs == 0))
    curve = roc_curve(scores, labels)
    assert curve.area == pytest.approx(expected)
    for rates in (curve.false_positive, curve.true_positive, on_grid(curve)):
        assert np.all(np.diff(rates) >= 0.0)
        assert rates[-1] == 1.0
    flipped = roc_curve(-scores, labels)
    assert flipped.area == pytest.approx(1.0 - curve.area)


def test_perfect_and_blind_scores():
    labels = np.array([0, 1, 0, 1])
    assert roc_curve(labels, labels).area == 1.0
    blind = roc_curve(np.zeros(4), labels)
    assert blind.area == 0.5
    np.testing.assert_allclose(on_grid(blind), GRID)


def test_needs_both_labels():
    with pytest.raises(ArgumentError, match="labels"):
        roc_curve(np.arange(3), np.ones(3))

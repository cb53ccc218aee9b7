# SPDX-License-Identifier: Apache-2.0
"""Learning which task follows which."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from intent_recognition.errors import ShapeError
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions


def test_counts_by_hand_and_how_far_they_are_believed(rng):
    counts = count_transitions([("a", "b", "a", "b"), ("c", "x", "a"), ()], ("a", "b", "c"))
    expected = [[0, 2, 0], [1, 0, 0], [1, 0, 0], [1, 0, 1]]
    np.testing.assert_array_equal(counts, expected)
    np.testing.assert_allclose(smoothed_transitions(np.zeros((4, 3))), 1 / 3)
    truth = rng.dirichlet(np.ones(3), size=4)
    counts = np.array([rng.multinomial(20000, row) for row in truth])
    np.testing.assert_allclose(smoothed_transitions(counts), truth, atol=0.015)
    row = [3, 0, 0]
    habit = smoothed_transitions([row, [0, 30, 0], [0, 0, 30], [30, 0, 0]])
    none = smoothed_transitions([row, [10, 11, 9], [9, 10, 11], [11, 9, 10]])
    assert habit[0, 0] > none[0, 0] + 0.2


@given(hnp.arrays(np.int64, (4, 3), elements=st.integers(0, 200)))
def test_smoothed_rows_are_distributions_that_keep_the_order_of_the_counts(counts):
    prior = smoothed_transitions(counts)
    np.testing.assert_allclose(prior.sum(axis=1), 1.0, rtol=0.0, atol=1e-12)
    assert np.all(prior > 0.0)
    for n, row in zip(counts, prior, strict=True):
        order = np.argsort(n, kind="stable")
        assert np.all(np.diff(row[order]) >= -1e-12)
        share = n / n.sum() if n.sum() else np.full(3, 1 / 3)  # between data and uniform
        assert np.all(row <= np.maximum(share, 1 / 3) + 1e-12)
        assert np.all(row >= np.minimum(share, 1 / 3) - 1e-12)


@pytest.mark.parametrize("shape", [(3, 3), (4,), (3, 4)])
def test_counts_of_another_shape_are_refused(shape):
    with pytest.raises(ShapeError, match="counts"):
        smoothed_transitions(np.zeros(shape))

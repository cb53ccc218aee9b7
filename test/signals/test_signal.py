# SPDX-License-Identifier: Apache-2.0
"""Signals keep what was measured and refuse what cannot be a measurement."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from simulation import START_NS

from intent_recognition.errors import ArgumentError, ShapeError
from intent_recognition.signals.signal import Signal


def test_a_signal_copies_and_freezes_its_arrays_and_keeps_nanoseconds():
    stamps, values = np.array([1, 2]), np.zeros((2, 1))
    signal = Signal(("x",), stamps, values, "m")
    stamps[0] = 0
    values[0] = 9.0
    assert signal.stamps_ns.tolist() == [1, 2]
    assert signal.values.tolist() == [[0.0], [0.0]]
    with pytest.raises(ValueError, match="read-only"):
        signal.values[0] = 1.0
    stamps = START_NS + np.array([0, 1, 1_000_000_001])
    signal = Signal(("x",), stamps, np.zeros((3, 1)), "m")
    assert signal.stamps_ns.dtype == np.int64
    np.testing.assert_allclose(signal.seconds(START_NS), [0.0, 1e-9, 1.000000001], rtol=1e-15)
    empty = Signal(("x", "y"), [], np.zeros((0, 2)), "m")
    assert empty.between(0, 10).values.shape == (0, 2)


@given(st.lists(st.integers(1, 100), unique=True), st.integers(0, 101), st.integers(0, 101))
def test_between_keeps_both_ends(stamps, start, end):
    stamps = sorted(stamps)
    signal = Signal(("x",), stamps, np.array(stamps, dtype=float).reshape(-1, 1), "m")
    expected = [stamp for stamp in stamps if start <= stamp <= end]
    assert signal.between(start, end).stamps_ns.tolist() == expected
    assert signal.between(start, end).values[:, 0].tolist() == expected


@pytest.mark.parametrize(
    ("stamps", "values", "error", "words"),
    [
        ([1, 2], np.zeros((2, 2)), ShapeError, r"values: expected shape \(2, 1\).*got \(2, 2\)"),
        ([1, 2], np.zeros(2), ShapeError, r"values: .*got \(2,\).*Stack"),
        ([1, 1], np.zeros((2, 1)), ArgumentError, "stamps_ns: .*got 1 then 1.*duplicates"),
        ([1, 5, 3], np.zeros((3, 1)), ArgumentError, "got 5 then 3"),
        ([1, 2], [[0.0], [np.nan]], ArgumentError, "values: expected finite.*Leave such"),
        ([1, 2], [[0.0], [np.inf]], ArgumentError, "values: expected finite"),
    ],
)
def test_a_signal_says_what_is_wrong(stamps, values, error, words):
    with pytest.raises(error, match=words):
        Signal(("x",), stamps, values, "m")

# SPDX-License-Identifier: Apache-2.0
"""Warps run forward, invert, and say what they were built from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intent_recognition.alignment.warp import Warp
from intent_recognition.errors import ArgumentError

shifts = st.floats(-2.0, 2.0)
phases = st.lists(st.floats(-3.0, 4.0), min_size=2, max_size=50, unique=True).map(sorted)


@given(st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=60).map(np.array), shifts, phases)
def test_inverse_undoes_apply(log_rate, shift, phase):
    warp = Warp(shift, log_rate)
    np.testing.assert_allclose(warp.inverse(warp.apply(phase)), phase, atol=1e-9)
    np.testing.assert_allclose(warp.apply(warp.inverse(phase)), phase, atol=1e-9)


def test_a_constant_rate_is_a_straight_line_beyond_the_ends_too():
    warp = Warp(0.2, np.full(10, np.log(1.5)))
    np.testing.assert_allclose(warp.apply([-1.0, 0.0, 0.5, 2.0]), [-1.3, 0.2, 0.95, 3.2])


def test_a_warp_cannot_be_changed():
    given_rates = np.zeros(5)
    warp = Warp(0.0, given_rates)
    given_rates[:] = 1.0
    assert np.all(warp.log_rate == 0.0)
    with pytest.raises(ValueError):
        warp.log_rate[0] = 1.0
    with pytest.raises(ValueError):
        warp.recorded[0] = 1.0


@pytest.mark.parametrize(
    ("shift", "log_rate"),
    [(np.nan, np.zeros(3)), (0.0, np.array([0.0, np.inf])), (0.0, np.array([0.0, 7.0]))],
)
def test_what_is_no_warp_is_refused(shift, log_rate):
    with pytest.raises(ArgumentError, match="log_rate"):
        Warp(shift, log_rate)

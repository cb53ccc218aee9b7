# SPDX-License-Identifier: Apache-2.0
"""The pace of simulated time follows the lag of the nodes."""

from hypothesis import given
from hypothesis import strategies as st

from benchmarks.pace_keeper import LAG_HIGH_S, LAG_LOW_S, SLOWEST, next_factor

factors = st.floats(0.2, 5.0)


@given(factors, factors, st.floats(0.0, 10.0))
def test_never_faster_than_asked_and_never_still(factor, asked, lag):
    new = next_factor(min(factor, asked), asked, lag)
    assert min(SLOWEST, asked) <= new <= asked


@given(factors)
def test_slows_down_while_lagging_and_comes_back(asked):
    factor = asked
    for _ in range(30):
        factor = next_factor(factor, asked, LAG_HIGH_S * 1.01)
    assert factor == min(SLOWEST, asked)
    for _ in range(60):
        factor = next_factor(factor, asked, LAG_LOW_S * 0.99)
    assert factor == asked


def test_holds_in_between():
    assert next_factor(0.7, 2.0, 0.5 * (LAG_LOW_S + LAG_HIGH_S)) == 0.7

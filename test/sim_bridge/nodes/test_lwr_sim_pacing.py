# SPDX-License-Identifier: Apache-2.0
"""Pacing of the physics against a made-up clock."""

import pytest

from intent_recognition.errors import ArgumentError
from sim_bridge.nodes.physics_clock import Pacer


def paced(factor, start_s, largest_batch=40):
    """A pacer whose clock stands at a time."""
    pacer = Pacer(0.001, factor, largest_batch)
    assert pacer.due(start_s, 0) == 0 and pacer.begun
    return pacer


@pytest.mark.parametrize("factor", [0.25, 1.0, 3.0])
def test_keeps_the_factor(factor):
    pacer = paced(factor, 100.0)
    done = 0
    for k in range(1, 1001):
        done += pacer.due(100.0 + 0.002 * k, done)
    assert done == pytest.approx(2000 * factor, abs=1)
    assert pacer.achieved_factor(102.0, done) == pytest.approx(factor, rel=1e-3)
    assert pacer.dropped_s == 0.0


def test_a_backlog_is_caught_up_in_batches_or_dropped_and_clocks_may_be_set_back():
    pacer = paced(1.0, 10.0)
    done, batches = 0, []
    while due := pacer.due(10.09, done):
        batches.append(due)
        done += due
    assert batches == [40, 40, 10]
    assert pacer.dropped_s == 0.0
    pacer = paced(2.0, 10.0, 1000)
    assert pacer.due(15.0, 0) == 100
    assert pacer.dropped_s == pytest.approx(9.9)
    assert pacer.due(15.0, 100) == 0
    assert pacer.due(15.01, 100) == 20
    assert pacer.achieved_factor(15.01, 120) == pytest.approx(0.12 / 5.01)
    pacer = paced(2.0, 10.0)
    assert pacer.due(9.0, 0) == 0
    assert pacer.due(9.01, 0) == 20
    pacer = Pacer(0.001, 1.0)
    assert pacer.due(0.0, 0) == 0 and not pacer.begun


@pytest.mark.parametrize("arguments", [(0.0, 1.0), (0.001, 0.0)])
def test_bad_arguments(arguments):
    with pytest.raises(ArgumentError):
        Pacer(*arguments)


def test_another_factor_holds_from_the_moment_it_is_set_and_keeps_the_backlog():
    pacer = paced(2.0, 10.0)
    assert pacer.due(10.01, 0) == 20
    pacer.change_factor(0.5, 10.01, 20)
    assert pacer.due(10.01, 20) == 0
    assert pacer.due(10.05, 20) == 20
    pacer = paced(1.0, 10.0)
    lag = pacer.lag(10.03, 10)
    pacer.change_factor(3.0, 10.03, 10)
    assert abs(pacer.lag(10.03, 10) - lag) < 1e-12

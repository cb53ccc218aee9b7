# SPDX-License-Identifier: Apache-2.0
"""Stamps of the physics by two clocks, of which neither waits for the other."""

import time
from types import SimpleNamespace

import pytest

from sim_bridge.nodes.physics_clock import PhysicsClock


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_losing_the_processor_between_two_clocks_shifts_no_stamp(monkeypatch, factor):
    passed_s, taken_s = 0.0, 0.0

    def now():
        nonlocal passed_s, taken_s
        passed_s, taken_s = passed_s + taken_s, 0.0  # before this clock is read
        return SimpleNamespace(nanoseconds=round((1000.0 + passed_s) * 1e9))

    monkeypatch.setattr(time, "monotonic", lambda: 50.0 + passed_s)
    parameter = SimpleNamespace(value=False)
    node = SimpleNamespace(
        get_parameter=lambda name: parameter, get_clock=lambda: SimpleNamespace(now=now)
    )
    arm = SimpleNamespace(n_steps=0, time_s=0.0)
    clock = PhysicsClock(node, arm, factor, publishes=False, rate_hz=200.0)
    clock.due()
    begun = clock.zero_ns()
    passed_s, taken_s = 1.0, 0.004
    assert clock.zero_ns() == pytest.approx(begun, abs=1000)

# SPDX-License-Identifier: Apache-2.0
"""Simulated time: its pace against a made-up clock, its stamps, and whose answers it waits for."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from sim_bridge.arm import NO_ANSWER_S
from sim_bridge.nodes import clock_answers
from sim_bridge.nodes.clock_answers import LEFT_S, ClockAnswers
from sim_bridge.nodes.physics_clock import Pacer, PhysicsClock


def paced(factor, start_s, largest_batch=40):
    """A pacer whose clock stands at a time."""
    pacer = Pacer(factor, largest_batch)
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
    pacer = Pacer(1.0, 40)
    assert pacer.due(0.0, 0) == 0 and not pacer.begun


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


NAME = "primitive_activation"


@pytest.fixture
def waiting(monkeypatch):
    """Time that stands still since 0 for a node that answered once, and what happened."""
    happened = SimpleNamespace(now_s=100.0, there=[(NAME, "/lab/a")], rejected=[], values={})
    monkeypatch.setattr(clock_answers.time, "monotonic", lambda: happened.now_s)
    diagnostics = SimpleNamespace(
        reject=lambda *told: happened.rejected.append(told), value=happened.values.__setitem__
    )
    node = SimpleNamespace(
        get_namespace=lambda: "/lab/a",
        get_node_names_and_namespaces=lambda: [(NAME, "/lab/b"), *happened.there],
    )
    answers = ClockAnswers(node, [NAME], diagnostics, ["joint_trajectory"])

    def answer(*n):
        message = JointState(name=["joint_states"], position=[float(one) for one in n])
        message.header.frame_id = NAME
        answers.hear(message)

    answer(0)
    assert not answers.wait()
    answers.note("joint_states")
    assert answers.wait()
    return answers, answer, happened


def test_time_goes_on_with_the_answer_or_soon_once_a_node_has_left(waiting):
    answers, answer, happened = waiting
    answer(1)
    assert answers.all_came() and not answers.wait() and not happened.rejected
    answers.note("joint_states")
    happened.there = []
    happened.now_s += LEFT_S / 2
    assert answers.wait()
    happened.now_s += LEFT_S
    assert not answers.wait() and not happened.rejected


@pytest.mark.parametrize("numbers", [(), (1, 1), (np.nan,), (np.inf,)])
def test_an_answer_that_cannot_be_read_is_rejected(waiting, numbers):
    answers, answer, happened = waiting
    answer(*numbers)
    assert happened.rejected[0][0] == "bad_answer" and not answers.all_came()


def test_a_node_that_does_not_answer_is_named_and_waited_for_no_more(waiting):
    answers, _, happened = waiting
    happened.now_s += NO_ANSWER_S - 0.1
    assert answers.wait() and not happened.rejected
    happened.now_s += 0.2
    assert not answers.wait()
    ((reason, text),) = happened.rejected
    assert reason == "no_answer" and f"{NAME} has not answered for 10 s" in text
    assert happened.values == {"not waited for": NAME}
    answers.note("joint_states")
    assert not answers.wait()

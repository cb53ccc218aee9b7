# SPDX-License-Identifier: Apache-2.0
"""Simulated time stands still for an answer, and goes on without who gives none."""

from types import SimpleNamespace

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from sim_bridge.arm import NO_ANSWER_S
from sim_bridge.nodes import clock_answers
from sim_bridge.nodes.clock_answers import LEFT_S, ClockAnswers

NAME = "primitive_activation"


@pytest.fixture
def waiting(monkeypatch):
    """Time that stands still since 0 for a node that answered once, and what happened."""
    happened = SimpleNamespace(now_s=100.0, there=[NAME], rejected=[], values={})
    monkeypatch.setattr(clock_answers.time, "monotonic", lambda: happened.now_s)
    diagnostics = SimpleNamespace(
        reject=lambda *told: happened.rejected.append(told), value=happened.values.__setitem__
    )
    node = SimpleNamespace(get_node_names=lambda: happened.there)
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

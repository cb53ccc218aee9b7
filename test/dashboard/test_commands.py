# SPDX-License-Identifier: Apache-2.0
"""What the page asks of other nodes, and what it learns of them."""

import pytest
from rclpy.node import Node
from std_srvs.srv import Trigger

from intent_recognition.dashboard.commands import Commands
from intent_recognition.nodes.primitive_activation import PrimitiveActivation


@pytest.fixture
def told():
    return []


@pytest.fixture
def commands(harness, told):
    return Commands(harness.probe, lambda ok, text: told.append((ok, text)))


def test_page_knows_whether_the_robot_helps_whoever_switched_it(harness, commands, told):
    node = harness.add(PrimitiveActivation())
    harness.spin_until(commands.can_switch_help)
    for helps in (False, True):
        commands.robot_helps(helps)
        harness.spin_until(lambda wanted=helps: node.active is wanted)
        commands.ask_for_help()
        harness.spin_until(lambda wanted=helps: commands.helping is wanted)
    harness.spin_until(lambda: len(told) == 2)
    assert [ok for ok, _ in told] == [True, True]


def test_what_is_switched_already_is_not_switched_again(harness, commands, told):
    harness.add(PrimitiveActivation())
    harness.spin_until(commands.can_switch_help)
    commands.robot_helps(True)
    harness.spin_until(lambda: told)
    assert told == [(True, "")]


def test_a_service_that_does_not_answer_is_called_once(harness, commands, told, monkeypatch):
    silent = Node("silent")
    try:
        silent.create_service(Trigger, "silent/undo", lambda _, answer: answer)
        harness.spin_until(lambda: commands.offers("silent/undo"))
        for _ in range(100):
            commands.trigger("silent/undo")
        assert told == [(False, "silent/undo has not answered the last call yet")] * 99
        monkeypatch.setattr("intent_recognition.dashboard.commands.ANSWER_S", 0.0)
        for _ in range(5):
            commands.trigger("silent/undo")
        assert told[99:] == [(False, "silent/undo did not answer")] * 5
        assert len(commands._clients["silent/undo"]._pending_requests) == 1
        monkeypatch.undo()
        harness.executor.add_node(silent)
        harness.spin_until(lambda: len(told) > 104)
        assert told[-1][1] == "silent/undo"
    finally:
        harness.executor.remove_node(silent)
        silent.destroy_node()


def test_no_answer_is_awaited_of_a_node_that_is_gone(harness, commands, told):
    dying = Node("dying")
    dying.create_service(Trigger, "dying/stop", lambda _, answer: answer)
    harness.spin_until(lambda: commands.offers("dying/stop"))
    commands.trigger("dying/stop")
    commands.give_up_lost()
    assert not told
    dying.destroy_node()
    harness.spin_until(lambda: not commands.offers("dying/stop"))
    commands.give_up_lost()
    assert told == [(False, "dying/stop did not answer")]


def test_nobody_there_is_told_at_once(commands, told):
    commands.trigger("nobody/start")
    assert told == [(False, "no node offers nobody/start")]

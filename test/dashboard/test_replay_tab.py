# SPDX-License-Identifier: Apache-2.0
"""A player ends whatever the executor still has to do for it."""

from types import SimpleNamespace

import pytest
from dashboard.browser import free_port
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.dashboard.cell import PersonState
from intent_recognition.dashboard.node import Dashboard
from intent_recognition.nodes import qos


def test_a_timer_of_the_player_that_is_due_when_it_ends_does_no_harm(harness):
    player = Node("player")
    harness.executor.add_node(player)
    out = player.create_publisher(String, "played", 10)
    stopped = []

    def stop():
        if not stopped:
            stopped.append(True)
            Dashboard._stop(SimpleNamespace(executor=harness.executor), player)

    first = harness.probe.create_timer(0.1, stop)
    second = player.create_timer(0.2, lambda: out.publish(String()))
    while not (first.is_ready() and second.is_ready()):  # both are queued, in this order
        pass
    harness.spin_until(lambda: stopped)
    again = harness.probe.create_timer(0.01, lambda: stopped.append(True))
    harness.spin_until(lambda: len(stopped) > 3)
    again.cancel()


@pytest.mark.slow
def test_where_people_have_names_the_first_one_moves_as_recorded(harness, repository):
    node = harness.node(Dashboard, port=free_port())
    for name in ("ben", "anna"):
        node.state.people[name] = PersonState()
    moved = harness.collect(PoseStamped, "mocap/anna/wrist/pose", qos.SENSOR)
    player = node._play(repository / "bags/toolbox/test/plate_handover_00", 0.0, 5.0)
    harness.spin_until(lambda: moved, what="the recorded wrist")
    node._stop(player)

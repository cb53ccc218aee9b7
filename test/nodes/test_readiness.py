# SPDX-License-Identifier: Apache-2.0
"""What begins something waits until the nodes of its graph are active and matched."""

import pytest
from bag_builder import write_bag
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from model_builder import WRIST, learned_model, make_dofs
from nav_msgs.msg import Odometry
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from std_msgs.msg import Empty

from intent_recognition.model.file import save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.diagnostics import Readiness
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest


@pytest.mark.parametrize(
    ("rows", "ready"),
    [
        ({}, True),
        ({"lifecycle": "active"}, True),
        ({"lifecycle": "not active"}, False),
        ({"publishers heard": "1"}, True),
        ({"publishers heard": "0"}, False),
        ({"publishers nobody/says": "0"}, True),
    ],
)
def test_a_node_is_ready_when_active_and_matched(harness, rows, ready):
    node = harness.add(Node("player", namespace="/cell"))
    readiness = Readiness(node, ["worker", ""])
    assert readiness.missing() == ["worker"]
    harness.probe.create_publisher(Empty, "/cell/heard", 1)
    reports = harness.publisher(DiagnosticArray, "/diagnostics")
    harness.connect(reports)
    harness.spin_until(lambda: node.count_publishers("heard"), what="the publisher")
    values = [KeyValue(key=key, value=value) for key, value in rows.items()]
    status = [
        DiagnosticStatus(name="cell/worker", values=values),
        DiagnosticStatus(name="worker"),
        DiagnosticStatus(name="cell/last"),
    ]
    reports.publish(DiagnosticArray(status=status))
    harness.spin_until(lambda: "cell/last" in readiness._reports, what="the report")
    assert readiness.missing() == ([] if ready else ["worker"])


@pytest.mark.slow
def test_a_player_loses_nothing_to_nodes_that_come_late(harness, tmp_path):
    model = tmp_path / "m.npz"
    save_model(model, learned_model(make_dofs(WRIST)))
    bag = write_bag(tmp_path / "bag", 8)  # as many as the queues hold, however busy the machine
    player = harness.node(
        BagPlayer,
        bag=str(bag),
        wait_for_nodes=["mocap_ingest", "intent_estimator"],
        wait_for_subscribers=0.5,
    )
    ingest = harness.node(MocapIngest)
    harness.spin_until(lambda: player._readiness.missing() == ["intent_estimator"], what="ingest")
    estimator = harness.node(IntentEstimatorNode, model=str(model), autostart=False)
    name = "intent_estimator"
    harness.spin_until(lambda: name in player._readiness._reports, what="a report")
    assert player.published == 0 and player._readiness.missing() == [name]
    taken = harness.collect(Odometry, "human/wrist", qos.SENSOR)
    for trigger in (estimator.trigger_configure, estimator.trigger_activate):
        assert trigger() == TransitionCallbackReturn.SUCCESS
    harness.spin_until(player.finished.is_set, what="the end")
    harness.spin_until(lambda: estimator._diagnostics._totals["human/wrist"] == 8)
    harness.spin_until(lambda: len(taken) == 8)  # one at a time, the estimator takes all at once
    assert not ingest._diagnostics._counts

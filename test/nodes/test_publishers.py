# SPDX-License-Identifier: Apache-2.0
"""A node tells how many publish a stream, those aside that it cannot hear."""

import uuid

from geometry_msgs.msg import PoseStamped
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.primitive_activation import PrimitiveActivation

ALONE = f"alone_{uuid.uuid4().hex}"
"""A namespace where no other process publishes, whoever shares the domain."""


def publishers(diagnostics, topic):
    return values_of(diagnostics.report())[f"publishers {topic}"]


def test_publishers_that_come_and_go_are_told(harness):
    bodies = Parameter("bodies", value=["wrist", "elbow"])
    node = harness.add(MocapIngest(namespace=ALONE, parameter_overrides=[bodies]))
    topic = "mocap/elbow/pose"
    made = [harness.publisher(PoseStamped, f"/{ALONE}/{topic}", qos.SENSOR) for _ in range(2)]
    harness.spin_until(lambda: publishers(node._diagnostics, topic) == "2")
    for count, publisher in zip(("1", "0"), made, strict=True):
        harness.probe.destroy_publisher(publisher)
        harness.spin_until(lambda n=count: publishers(node._diagnostics, topic) == n)
    assert publishers(node._diagnostics, "mocap/wrist/pose") == "0"


def test_tasks_that_offer_too_little_are_not_heard(harness):
    """Joint states are: many drivers send them best effort."""
    node = harness.add(PrimitiveActivation(namespace=ALONE))
    for topic in ("joint_states", "intent/tasks"):
        harness.publisher(JointState, f"/{ALONE}/{topic}", qos.SENSOR)
    harness.spin_until(lambda: publishers(node.diagnostics, "joint_states") == "1")
    harness.spin_until(lambda: node.count_publishers("intent/tasks") == 1)
    assert publishers(node.diagnostics, "intent/tasks") == "0"

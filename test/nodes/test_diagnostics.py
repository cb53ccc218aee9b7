# SPDX-License-Identifier: Apache-2.0
"""What nodes report, what they lack, who is heard, and who is ready."""

import sys
import threading
import uuid
from types import SimpleNamespace

import pytest
from bag_builder import write_bag
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from model_builder import WRIST, learned_model, make_dofs
from nav_msgs.msg import Odometry
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros_harness import node_with
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from intent_recognition.model.file import save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.diagnostics import Diagnostics, Level, Readiness, values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.nodes.primitive_activation import PrimitiveActivation


class FakeClock:
    """Seconds under the test's control."""

    def __init__(self):
        self.now_s = 100.0

    def __call__(self):
        return self.now_s


def test_diagnostics_measure(harness):
    clock = FakeClock()
    diagnostics = Diagnostics(node_with(harness), clock=clock)
    for _ in range(50):
        diagnostics.tick("pose")
    for i in range(1, 101):
        diagnostics.latency(i * 1e-3)
    diagnostics.count("jump", 2)
    diagnostics.value("task", "plate")
    diagnostics.status(1, "no input")
    clock.now_s += 0.5
    status = diagnostics.report()
    assert status.name == "owner"
    assert status.level == b"\x01"
    assert status.message == "no input"
    values = values_of(status)
    assert values["rate pose [Hz]"] == "100.0"
    assert values["rejected jump"] == "2"
    assert values["task"] == "plate"
    assert float(values["latency p50 [ms]"]) == pytest.approx(50.5)
    assert float(values["latency p99 [ms]"]) == pytest.approx(99.01)
    clock.now_s += 1.0
    values = values_of(diagnostics.report())
    assert values["rate pose [Hz]"] == "0.0"
    assert values["received pose"] == "50"
    assert values["rejected jump"] == "2"


def diagnosed(harness, **overrides):
    """Diagnostics of a node that needs `pose`, where nothing is amiss, and their clock."""
    clock, node = FakeClock(), node_with(harness, **overrides)
    diagnostics = Diagnostics(node, period_s=1e4, clock=clock)  # reports when it is asked
    diagnostics.subscribe(PoseStamped, "pose", lambda _: None, qos.SENSOR, needed=True)
    assert diagnostics.report().message == "running"
    return diagnostics, clock


def hear(diagnostics, clock, stream, seconds=1):
    """Take a message of a stream each second; the last status."""
    for _ in range(seconds):
        diagnostics.tick(stream)
        clock.now_s += 1.0
        status = diagnostics.report()
    return status.level, status.message


OK, WARN = bytes([Level.OK]), bytes([Level.WARN])


def test_a_status_warns_of_a_stream_that_is_needed_and_silent_until_it_is_heard(harness):
    diagnostics, clock = diagnosed(harness)
    clock.now_s += 2.9
    assert diagnostics.report().level == OK
    clock.now_s += 4.1
    assert hear(diagnostics, clock, "tasks")[1] == "nothing on /pose for 8 s (publishers: 0)"
    diagnostics.status(Level.WARN, "hand lost")
    assert diagnostics.report().message.startswith("hand lost; nothing on /pose")
    diagnostics.status(Level.OK, "idle")
    assert hear(diagnostics, clock, "pose") == (OK, "idle")


def test_no_stream_is_missed_while_simulated_time_stands_still(harness):
    diagnostics, clock = diagnosed(harness, use_sim_time=True)
    levels = []
    for now_s in (1, 1, 1, 1, 1, 1, 2, 3, 4, 5):
        harness.set_clock(harness.nodes[-1], now_s * 10**9)
        clock.now_s += 1.0
        levels.append(diagnostics.report().level)
    assert levels == [OK] * 9 + [WARN]


def test_silence_is_that_of_slow_simulated_time_while_somebody_publishes_it(harness):
    diagnostics, clock = diagnosed(harness, use_sim_time=True)
    node = harness.nodes[-1]
    source = node.create_publisher(Clock, "/clock", 1)
    harness.set_clock(node, 10**9)
    diagnostics.tick("pose")
    clock.now_s += 2.0
    harness.set_clock(node, 1_100_000_000)
    assert diagnostics.silent_s("pose") == pytest.approx(0.1)
    assert diagnostics.silent_s("never") == pytest.approx(1.1)
    subscription = node.create_subscription(PoseStamped, "later", lambda _: None, 1)
    diagnostics.watch(subscription, "later", needed=True)
    clock.now_s += 2.0
    harness.set_clock(node, 1_300_000_000)
    assert diagnostics.silent_s("later") == pytest.approx(0.2)
    node.destroy_publisher(source)
    assert diagnostics.silent_s("pose") == pytest.approx(4.0)


def test_a_status_warns_of_simulated_time_without_a_clock(harness):
    diagnostics, clock = diagnosed(harness, use_sim_time=True)
    level, message = hear(diagnostics, clock, "tasks", seconds=5)
    assert level == WARN and message.startswith("waiting for /clock: let one")
    harness.set_clock(harness.nodes[-1], 10**9)
    assert hear(diagnostics, clock, "tasks") == (OK, "running")
    for _ in range(2):
        harness.publisher(Clock, "/clock")
    harness.spin_until(lambda: harness.probe.count_publishers("/clock") == 2, what="both")
    assert diagnostics.report().message == "2 nodes publish /clock: end all but one"


def test_rejections_are_logged_once_a_second_for_each_reason(harness, monkeypatch):
    clock, lines = FakeClock(), []
    node = node_with(harness)
    diagnostics = Diagnostics(node, clock=clock)

    class Logger:
        warning = staticmethod(lines.append)

    monkeypatch.setattr(node, "get_logger", lambda: Logger)
    for _ in range(30):
        diagnostics.reject("jump", "far")
        diagnostics.reject("late", "old")
        clock.now_s += 0.1
    assert len([line for line in lines if line.startswith("jump")]) == 3
    assert len([line for line in lines if line.startswith("late")]) == 3
    assert diagnostics.rejected("jump") == 30


def test_diagnostics_go_on_while_simulated_time_stands_still(harness):
    reports = harness.collect(DiagnosticArray, "/diagnostics")
    Diagnostics(node_with(harness, use_sim_time=True), period_s=0.02)
    harness.spin_until(lambda: len(reports) > 2, what="reports")
    assert [status.name for status in reports[0].status] == ["owner"]


def test_messages_may_be_counted_by_another_thread_while_it_answers(harness, monkeypatch):
    diagnostics, told = Diagnostics(node_with(harness)), []
    heard_by_all = SimpleNamespace(get_subscription_count=lambda: 1, publish=told.append)
    monkeypatch.setattr(diagnostics, "_answers", heard_by_all)

    def count():
        for k in range(4000):
            diagnostics.tick(f"stream {k}")

    often, counting = sys.getswitchinterval(), threading.Thread(target=count)
    sys.setswitchinterval(1e-6)
    try:
        counting.start()
        while counting.is_alive():
            diagnostics.answer()
    finally:
        sys.setswitchinterval(often)
        counting.join()
    assert all(len(one.name) == len(one.position) for one in told)


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
    harness.spin_until(lambda: node.count_publishers("heard"), what="the publisher")
    values = [KeyValue(key=key, value=value) for key, value in rows.items()]
    status = [
        DiagnosticStatus(name="cell/worker", values=values),
        DiagnosticStatus(name="worker"),
    ]
    harness.hear(node, "/diagnostics", DiagnosticArray(status=status))
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

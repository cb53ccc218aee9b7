# SPDX-License-Identifier: Apache-2.0
"""The estimator node on its topics, beside the library fed with the same observations."""

import time
from dataclasses import replace

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from estimator_graph import DOFS, MIXED, Folder, Graph, check_tasks, expected, message_for
from geometry_msgs.msg import PoseStamped
from model_builder import ROBOT, WRIST, learned_model, true_library
from nav_msgs.msg import Odometry
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.errors import ArgumentError
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes import person_belief, qos
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.intent_output import MarkerBuilder, colour
from intent_recognition.report.drawing import task_colours


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("wrist"), DOFS)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("mixed"), MIXED)


@pytest.mark.slow
def test_tasks_are_the_library_s_and_predictions_come_at_their_rate(harness, wrist):
    graph = Graph(harness, wrist, publish_rate=10.0)
    observations = wrist.observations(2)
    graph.feed(observations)
    estimates = expected(wrist.model, observations)
    check_tasks(graph.tasks, estimates, wrist.model.labels)
    times_s = [e.stamp_ns * 1e-9 for e in estimates if e.moving]
    assert len(graph.robot) == pytest.approx(10.0 * (times_s[-1] - times_s[0]), abs=2)


def test_what_cannot_be_computed_is_counted_and_the_movement_forgotten(harness, wrist, monkeypatch):
    graph = Graph(harness, wrist)
    first, *rest = wrist.observations(1)[:90]

    def refuse(observation):
        raise ArgumentError("innovation covariance: none")

    with monkeypatch.context() as patch:
        patch.setattr(graph.node.people[""].estimator, "update", refuse)
        assert not graph.send(message_for(graph.dofs, first), first.group)
    assert graph.rejected("not_finite") == 1
    graph.feed(rest)
    check_tasks(graph.tasks, expected(wrist.model, rest), wrist.model.labels)


@pytest.mark.slow
def test_a_publisher_of_another_type_is_reported_once(harness, wrist):
    graph = Graph(harness, wrist)
    context = rclpy.Context()  # one process may not mix the types of a topic in one context
    rclpy.init(args=[], context=context)
    impostor = rclpy.create_node("impostor", context=context)
    try:
        impostor.create_publisher(PoseStamped, "human/wrist", qos.SENSOR)
        harness.spin_until(lambda: graph.rejected("wrong_type"))
        for _ in range(2):
            graph.node._diagnostics.publish()
        assert graph.rejected("wrong_type") == 1
        graph.feed(wrist.observations(0)[:5])
    finally:
        impostor.destroy_node()
        context.try_shutdown()


@pytest.mark.slow
def test_in_mid_movement_a_model_is_reloaded_unless_it_is_of_other_dofs(
    harness, wrist, mixed, tmp_path
):
    graph = Graph(harness, wrist)
    observations = wrist.observations(1)[:130]
    graph.feed(observations[:60])
    for path, word in ((mixed.path, "thumb"), ("/nowhere.npz", "/nowhere.npz"), ("", "model")):
        graph.node.set_parameters([Parameter("model", value=str(path))])
        answer = graph.call("reload_model")
        assert not answer.success and word in answer.message
    graph.feed(observations[60:80])
    check_tasks(graph.tasks, expected(wrist.model, observations[:80]), wrist.model.labels)
    fewer = learned_model(DOFS, wrist.truth, per_task=5).library
    other = Model(replace(fewer, onset=wrist.model.library.onset), DOFS)
    save_model(tmp_path / "other.npz", other)
    graph.node.set_parameters([Parameter("model", value=str(tmp_path / "other.npz"))])
    answer = graph.call("reload_model")
    assert answer.success and "task_0" in answer.message
    graph.feed(observations[80:])
    always = expected(other, observations)
    check_tasks(graph.tasks[80:], always[80:], other.labels)


@pytest.mark.slow
def test_nothing_is_lost_while_a_model_is_swapped(harness, wrist):
    """What arrives meanwhile waits, even hundreds of samples."""
    graph = Graph(harness, wrist)
    observations = wrist.observations(1)
    graph.feed(observations[:70])
    wrist_poses = harness.publisher(Odometry, "human/wrist", qos.SENSOR)
    harness.connect(wrist_poses)
    client = harness.probe.create_client(Trigger, "intent_estimator/reload_model")
    harness.spin_until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    for observation in observations[70:]:
        wrist_poses.publish(message_for(DOFS, observation))
    harness.spin_until(lambda: future.done() and len(graph.tasks) >= len(observations))
    assert future.result().success
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)


@pytest.mark.slow
def test_a_stream_that_stops_in_a_movement_is_said_and_taken_back(harness, wrist):
    """It does not stop while simulated time stands still."""
    graph = Graph(harness, wrist, use_sim_time=True)
    assert graph.status().message == "waiting for a movement"
    harness.set_clock(graph.node, 10_000_000_000)
    observations = wrist.observations(0)
    graph.feed(observations[:80])
    graph.node.people[""].look()
    assert graph.status().level == DiagnosticStatus.OK and graph.status().message == "moving"
    harness.set_clock(graph.node, 11_000_000_000)
    harness.spin_until(lambda: graph.status().level == DiagnosticStatus.WARN)
    assert "human stream stopped" in graph.status().message
    # what cannot be used does not count as the stream's return
    assert not graph.send(message_for(DOFS, observations[80]._replace(values=np.full(3, np.nan))))
    assert graph.status().level == DiagnosticStatus.WARN
    graph.feed(observations[80:82])
    assert graph.status().level == DiagnosticStatus.OK and graph.status().message == "moving"
    assert graph.call("reset").success
    assert graph.status().message == "waiting for a movement"


@pytest.mark.slow
def test_a_stream_too_slow_for_an_onset_is_said_with_topic_and_rates_while_it_comes(
    harness, wrist, monkeypatch
):
    graph = Graph(harness, wrist)
    resting = wrist.observations(0)
    for k, one in enumerate(resting[:3]):
        graph.feed([one._replace(stamp_ns=resting[0].stamp_ns + k * 10**9)])
    harness.spin_until(lambda: graph.status().level == DiagnosticStatus.WARN)
    assert "wrist/pose comes at 1 Hz" in graph.status().message
    assert "no movement is found below" in graph.status().message
    monkeypatch.setattr(person_belief, "elapsed_s", lambda _: time.monotonic() + 10.0)
    monkeypatch.setattr(graph.node._diagnostics, "_clock", lambda: time.monotonic() + 10.0)
    graph.node.people[""].look()
    assert graph.status().message.startswith("nothing on /human/wrist for 1")
    monkeypatch.undo()
    assert graph.call("reset").success
    assert graph.status().level == DiagnosticStatus.OK


@pytest.mark.slow
def test_activated_again_it_begins_anew_and_meanwhile_it_refuses(harness, wrist):
    """The services of a lifecycle node: test_lifecycle.py."""
    graph = Graph(harness, wrist)
    observations = wrist.observations(2)[:90]
    graph.feed(observations[:60])
    for transition in ("deactivate", "cleanup", "configure", "activate"):
        getattr(graph.node, f"trigger_{transition}")()
        if transition in ("deactivate", "configure"):
            assert not graph.call("reset").success and not graph.call("reload_model").success
            assert graph.status().message == "not active"
    del graph.tasks[:]
    graph.feed(observations)
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)


def test_an_activation_that_fails_half_way_leaves_nothing_subscribed(harness, tmp_path):
    gripper = DofEntry("gripper/width", "nowhere_msgs/msg/Width", fields=("width",), unit="m")
    dofs = DofSpec((WRIST,), (ROBOT, gripper))
    path = tmp_path / "m.npz"
    save_model(path, Model(true_library(dofs), dofs))
    given = {"model": str(path), "autostart": False}
    node = harness.node(IntentEstimatorNode, **given)
    before = sorted(subscription.topic_name for subscription in node.subscriptions)
    node.trigger_configure()
    for _ in range(2):
        assert node.trigger_activate() is TransitionCallbackReturn.FAILURE
        assert not node.active
        topics = sorted(subscription.topic_name for subscription in node.subscriptions)
        assert topics == before


def check_markers(graph, folder, observations):
    """Observed and predicted path, tube and label."""
    observed, predicted, tube, text = graph.markers[-1].markers
    kinds = (Marker.LINE_STRIP, Marker.LINE_STRIP, Marker.TRIANGLE_LIST, Marker.TEXT_VIEW_FACING)
    assert tuple(m.type for m in (observed, predicted, tube, text)) == kinds
    assert len({(m.ns, m.id) for m in (observed, predicted, tube, text)}) == 4
    assert all(m.header.frame_id == "world" and m.color.a > 0 for m in graph.markers[-1].markers)
    assert text.text.startswith("task 0") and text.text.endswith("%")
    own = colour(task_colours(folder.model.labels)["task_0"])
    for marker in (predicted, tube, text):
        drawn = (marker.color.r, marker.color.g, marker.color.b)
        assert drawn == pytest.approx((own.r, own.g, own.b))
    assert 0.0 < tube.color.a < 0.5
    seen = np.array([[p.x, p.y, p.z] for p in observed.points])
    given = np.array([o.values for o in observations])
    assert len(seen) > 50
    assert np.all(np.min(np.linalg.norm(seen[:, None] - given, axis=2), axis=1) < 1e-12)
    assert len(tube.points) % 3 == 0
    corners = np.array([[p.x, p.y, p.z] for p in tube.points])
    ends = np.array([[p.x, p.y, p.z] for p in (predicted.points[0], predicted.points[-1])])
    distance = np.linalg.norm(corners[:, None] - ends, axis=-1).min(axis=0)
    assert np.all(distance > 0.0)


@pytest.mark.slow
def test_the_predicted_path_of_the_body_among_three_topics_its_tube_and_its_markers(harness, mixed):
    graph = Graph(harness, mixed)
    told = harness.said(graph.node, "intent/human_trajectory")
    observations = mixed.observations(0)
    graph.feed(observations)
    check_tasks(graph.tasks, expected(mixed.model, observations), mixed.model.labels)
    observations = [o for o in observations if mixed.dofs.observed[o.group] == WRIST]
    end = observations[-1].values
    assert len(graph.path) > 10
    for message in graph.path:
        assert message.header.frame_id == "world" and len(message.poses) == 30
        stamps = [stamp_ns(pose) for pose in message.poses]
        assert stamps == sorted(stamps)
        assert abs(stamps[0] - stamp_ns(message)) < 1_500_000_000
    half = graph.path[len(graph.path) * 2 // 3].poses[-1].pose.position
    np.testing.assert_allclose((half.x, half.y, half.z), end, atol=0.08)
    check_markers(graph, mixed, observations)
    message = told[len(told) // 2]
    assert tuple(message.joint_names) == mixed.model.library.observed_names
    times_s, positions, rest = trajectory_arrays(message)
    assert np.all(np.diff(times_s) > 0.0) and np.all(rest["effort"] > 0.0)
    assert message.header.frame_id == mixed.model.labels[0]
    np.testing.assert_allclose(positions[-1, -3:], end, atol=4.0 * rest["effort"][-1].max())
    resting = [message for message in told if len(message.points) == 1]
    assert graph.node._diagnostics._totals["intent/human_trajectory"] == len(told)
    told_ns = np.array([stamp_ns(message) for message in resting])
    still = [stamp_ns(tasks) for tasks in graph.tasks if tasks.position[-1] == 1.0]
    assert told_ns[0] < still[5] and np.all(np.diff(told_ns) >= 39_000_000)
    for message, now_ns in zip(resting, told_ns, strict=True):
        seen = [o.values for o in observations if o.stamp_ns <= now_ns]
        off = np.abs(np.array(seen[-2:]) - message.points[0].positions[-3:]).max(axis=1)
        assert off.min() < 1e-9  # other topics have the same stamps
    del told[:]
    assert graph.call("reset").success
    later_ns = 10**10
    graph.feed([observations[-1]._replace(stamp_ns=observations[-1].stamp_ns + later_ns)])
    assert not told  # the other topics' values may be those of somebody else


def test_markers_keep_the_colour_of_a_task_when_another_is_learned():
    builder = MarkerBuilder(["plate"])
    builder.set_labels(["apple", "plate"])
    path = np.zeros((2, 3))
    _, plate, _, _ = builder.build(0, "world", "plate", 1.0, path, path).markers
    _, apple, _, _ = builder.build(0, "world", "apple", 1.0, path, path).markers
    assert plate.color == colour(task_colours(["plate"])["plate"])
    assert apple.color != plate.color

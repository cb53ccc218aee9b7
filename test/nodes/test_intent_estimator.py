# SPDX-License-Identifier: Apache-2.0
"""The estimator node on its topics, beside the library fed with the same observations."""

import time
from dataclasses import replace

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from model_builder import GLOVE, ROBOT, TOOL, WRIST, learned_model, make_dofs, perform, true_library
from nav_msgs.msg import Odometry, Path
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.errors import ArgumentError
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import (
    stamp_ns,
    to_joint_state,
    to_pose,
    to_stamp,
    trajectory_arrays,
)
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.markers import MarkerBuilder, colour
from intent_recognition.promp import NONE
from intent_recognition.recognition.estimator import CLOCK_RESET_AFTER, IntentEstimator
from intent_recognition.report.drawing import task_colours
from intent_recognition.signals.observation import Observation, merge

COVARIANCE = np.eye(3) * 4e-6
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
DOFS = make_dofs(WRIST)
MIXED = make_dofs(TOOL, GLOVE, WRIST)


class Folder:
    """Models of one DOF file on disk, and the truth they were learned from."""

    def __init__(self, folder, dofs):
        self.dofs, self.truth = dofs, true_library(dofs)
        self.model = learned_model(dofs, self.truth)
        self.path = folder / "model.npz"
        save_model(self.path, self.model)

    def observations(self, task=0, seed=100, **options) -> list[Observation]:
        found = merge(perform(self.truth, task, seed, **options).observed)
        return [with_covariance(self.dofs, observation) for observation in found]


def with_covariance(dofs, observation):
    entry = dofs.observed[observation.group]
    if entry != WRIST:
        return observation
    return observation._replace(covariance=COVARIANCE)


def shifted(observations, seconds):
    return [o._replace(stamp_ns=o.stamp_ns + round(seconds * 1e9)) for o in observations]


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("wrist"), DOFS)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("mixed"), MIXED)


def message_for(dofs, observation):
    """The message that carries an observation, as mocap_ingest or a driver sends it."""
    entry = dofs.observed[observation.group]
    if entry.joints:
        return to_joint_state(entry.joints, observation.values, time_ns=observation.stamp_ns)
    position = np.zeros(3)
    position[["xyz".index(field[-1]) for field in entry.fields]] = observation.values
    if entry == WRIST:
        message = Odometry(child_frame_id="wrist_world_aligned")
        message.pose.pose = to_pose(position, UPRIGHT)
        covariance = np.eye(6)
        covariance[:3, :3] = COVARIANCE
        message.pose.covariance = covariance.ravel()
    else:
        message = PoseStamped(pose=to_pose(position, UPRIGHT))
    message.header.stamp = to_stamp(observation.stamp_ns)
    message.header.frame_id = "world"
    return message


class Graph:
    """The node between a fake tracker and listeners of all its topics."""

    def __init__(self, harness, folder, *, listen=True, **parameters):
        self.harness, self.dofs, self.model = harness, folder.dofs, folder.model
        parameters = {"model": str(folder.path), **parameters}
        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        self.node = harness.add(IntentEstimatorNode(parameter_overrides=overrides))
        self.inputs = [
            harness.publisher(Odometry, "human/wrist", qos.SENSOR)
            if entry == WRIST
            else harness.publisher(JointState if entry.joints else PoseStamped, entry.topic, 10)
            for entry in self.dofs.observed
        ]
        self.tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
        self.robot = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
        if listen:
            self.path = harness.collect(Path, "intent/human_path", qos.COMMAND)
            self.markers = harness.collect(MarkerArray, "intent/markers", qos.COMMAND)
        if parameters.get("autostart", True):
            harness.connect(*self.inputs)
        topics = ("intent/tasks", "intent/robot_trajectory") + listen * ("intent/markers",)
        outputs = [p for p in self.node.publishers if p.topic_name.lstrip("/") in topics]
        harness.connect(*outputs)

    def send(self, message, group=0):
        """Publish and spin until the node has handled it; whether it was accepted."""
        seen, accepted = self.received(group), len(self.tasks)
        refused = sum(self.node._diagnostics._counts.values())
        self.inputs[group].publish(message)
        self.harness.spin_until(lambda: self.received(group) > seen, what="received")
        self.harness.spin_until(
            lambda: (
                len(self.tasks) > accepted or sum(self.node._diagnostics._counts.values()) > refused
            ),
            what="tasks or a count",
        )
        return len(self.tasks) > accepted

    def received(self, group):
        topic = self.dofs.observed[group].topic
        return self.node._diagnostics._totals[topic]

    def feed(self, observations):
        for observation in observations:
            message = message_for(self.dofs, observation)
            assert self.send(message, observation.group), observation

    def rejected(self, reason):
        return self.node._diagnostics.rejected(reason)

    def status(self):
        return self.node._diagnostics.report()

    def call(self, service):
        return self.harness.call(Trigger, f"intent_estimator/{service}", Trigger.Request())


def expected(model: Model, observations) -> list:
    estimator = IntentEstimator(model.library)
    return [estimator.update(observation) for observation in observations]


def check_tasks(messages, estimates, labels):
    assert len(messages) == len(estimates)
    for message, estimate in zip(messages, estimates, strict=True):
        assert list(message.name) == [*labels, NONE]
        assert stamp_ns(message) == estimate.stamp_ns
        assert abs(sum(message.position) - 1.0) <= 1e-9
        assert message.velocity[-1] == 0.0
        np.testing.assert_allclose(message.position, estimate.probabilities, rtol=0, atol=1e-12)
        np.testing.assert_allclose(message.velocity, estimate.phase, rtol=0, atol=1e-12)
        np.testing.assert_allclose(message.effort, estimate.log_evidence, rtol=1e-12, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("task", [0, 1, 2])
def test_tasks_are_the_library_s_and_the_right_one_wins(harness, wrist, task):
    graph = Graph(harness, wrist)
    observations = wrist.observations(task)
    graph.feed(observations)
    estimates = expected(wrist.model, observations)
    check_tasks(graph.tasks, estimates, wrist.model.labels)
    moving = [m for m, e in zip(graph.tasks, estimates, strict=True) if e.moving]
    assert np.argmax(moving[-1].position) == task and moving[-1].position[task] > 0.97
    assert all(m.position[-1] == 1.0 for m in graph.tasks[:20])  # at rest
    phases = [m.velocity[task] for m in moving]
    assert phases[-1] > 0.9 and np.all(np.diff(phases) > -0.05)


@pytest.mark.slow
def test_trajectory_is_filled_as_the_contract_says(harness, wrist):
    graph = Graph(harness, wrist, publish_rate=1000.0)
    observations = wrist.observations(1)
    graph.feed(observations)
    estimator = IntentEstimator(wrist.model.library)
    predictions = []
    for observation in observations:
        estimator.update(observation)
        predictions.append(estimator.predict_controlled())
    predictions = [p for p in predictions if p is not None]
    assert len(predictions) > 50
    harness.spin_until(lambda: len(graph.robot) >= len(predictions))
    for message, prediction in zip(graph.robot, predictions, strict=True):
        times, positions, rest = trajectory_arrays(message)
        assert list(message.joint_names) == list(wrist.model.controlled_names)
        assert message.header.frame_id == prediction.task
        assert stamp_ns(message) == prediction.onset_ns
        np.testing.assert_allclose(times, prediction.trajectory.times_s, atol=1e-9)
        np.testing.assert_array_equal(positions, prediction.trajectory.positions)
        np.testing.assert_array_equal(rest["velocities"], prediction.trajectory.velocities)
        np.testing.assert_array_equal(rest["effort"], prediction.trajectory.std)
        assert times[0] == 0.0 and np.all(np.diff(times) > 0) and np.all(rest["effort"] > 0)
        slope = np.gradient(positions, times, axis=0)[1:-1]
        np.testing.assert_allclose(rest["velocities"][1:-1], slope, atol=0.05)
    final = graph.robot[-1].points[-1].positions
    truth = perform(wrist.truth, 1, 100).controlled[0].values[-1]
    np.testing.assert_allclose(final, truth, atol=0.1)


@pytest.mark.slow
def test_nothing_is_predicted_for_a_movement_that_is_none_of_the_tasks(harness, wrist):
    graph = Graph(harness, wrist, publish_rate=1000.0)
    observations = wrist.observations(0)
    start = observations[0].values
    # the first task's reach, mirrored and turned: a way nobody went in training
    unknown = [o._replace(values=start - 1.5 * np.roll(o.values - start, 1)) for o in observations]
    graph.feed(unknown)
    estimates = expected(wrist.model, unknown)
    led = [e.moving and np.argmax(e.probabilities) < 3 for e in estimates]
    assert sum(e.moving for e in estimates) > 40
    half = len(led) // 2
    assert not any(led[half:])
    harness.spin_until(lambda: len(graph.robot) >= sum(led))
    assert len(graph.robot) == sum(led)


@pytest.mark.slow
def test_trajectories_come_at_the_rate_asked_for(harness, wrist):
    graph = Graph(harness, wrist, publish_rate=10.0)
    observations = wrist.observations(2)
    graph.feed(observations)
    moving = [e.stamp_ns for e in expected(wrist.model, observations) if e.moving]
    span_s = (moving[-1] - moving[0]) * 1e-9
    assert 10.0 * span_s - 2 <= len(graph.robot) <= 10.0 * span_s + 2


@pytest.mark.slow
def test_the_predicted_path_of_the_human(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(0)
    graph.feed(observations)
    end = observations[-1].values
    assert len(graph.path) > 10
    for message in graph.path:
        assert message.header.frame_id == "world" and len(message.poses) == 30
        stamps = [stamp_ns(pose) for pose in message.poses]
        assert stamps == sorted(stamps)
        assert abs(stamps[0] - stamp_ns(message)) < 1_500_000_000
    half = graph.path[len(graph.path) * 2 // 3].poses[-1].pose.position
    np.testing.assert_allclose((half.x, half.y, half.z), end, atol=0.08)


def test_the_human_s_tube_is_told_to_who_listens(harness, wrist):
    graph = Graph(harness, wrist, listen=False)
    told = harness.collect(JointTrajectory, "intent/human_trajectory", qos.COMMAND)
    harness.connect(graph.node.people[""].output.human_trajectory)
    observations = wrist.observations()
    graph.feed(observations[: len(observations) // 2])
    harness.spin_until(lambda: told)
    message = told[-1]
    assert tuple(message.joint_names) == wrist.model.library.observed_names
    times_s, positions, rest = trajectory_arrays(message)
    assert np.all(np.diff(times_s) > 0.0) and np.all(rest["effort"] > 0.0)
    assert message.header.frame_id == wrist.model.labels[0]
    last = observations[-1].values
    np.testing.assert_allclose(positions[-1], last, atol=4.0 * rest["effort"][-1].max())


@pytest.mark.slow
def test_markers_show_observed_and_predicted_path_tube_and_label(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(0)
    graph.feed(observations)
    observed, predicted, tube, text = graph.markers[-1].markers
    kinds = (Marker.LINE_STRIP, Marker.LINE_STRIP, Marker.TRIANGLE_LIST, Marker.TEXT_VIEW_FACING)
    assert tuple(m.type for m in (observed, predicted, tube, text)) == kinds
    assert len({(m.ns, m.id) for m in (observed, predicted, tube, text)}) == 4
    assert all(m.header.frame_id == "world" and m.color.a > 0 for m in graph.markers[-1].markers)
    assert text.text.startswith("task 0") and text.text.endswith("%")
    own = colour(task_colours(wrist.model.labels)["task_0"])
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


def test_markers_keep_the_colour_of_a_task_when_another_is_learned():
    builder = MarkerBuilder(["plate"])
    builder.set_labels(["apple", "plate"])
    path = np.zeros((2, 3))
    _, plate, _, _ = builder.build(0, "world", "plate", 1.0, path, path).markers
    _, apple, _, _ = builder.build(0, "world", "apple", 1.0, path, path).markers
    assert plate.color == colour(task_colours(["plate"])["plate"])
    assert apple.color != plate.color


@pytest.mark.slow
def test_only_the_body_that_is_predicted_is_drawn(harness, mixed):
    graph = Graph(harness, mixed)
    graph.feed(mixed.observations(0))
    drawn = np.array([[p.x, p.y, p.z] for p in graph.markers[-1].markers[0].points])
    wrist = [o.values for o in mixed.observations(0) if o.group == 2]
    apart = np.linalg.norm(drawn[:, None] - np.array(wrist), axis=2)
    assert np.all(np.min(apart, axis=1) < 1e-12)


def test_qualities_of_service_are_the_contract_s(harness, wrist):
    node = Graph(harness, wrist).node
    reliable = QoSReliabilityPolicy.RELIABLE
    offered = {p.topic_name: p.qos_profile for p in node.publishers}
    for topic, depth in (
        ("/intent/tasks", 10),
        ("/intent/robot_trajectory", 1),
        ("/intent/human_path", 1),
        ("/intent/markers", 1),
    ):
        profile = offered[topic]
        assert profile.reliability == reliable, topic
        assert profile.durability == QoSDurabilityPolicy.VOLATILE, topic
        assert profile.history == QoSHistoryPolicy.KEEP_LAST and profile.depth == depth, topic
    (human,) = (s for s in node.subscriptions if s.topic_name == "/human/wrist")
    assert human.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT


def test_a_namespace_applies_to_everything_but_diagnostics(harness, wrist):
    overrides = [Parameter("model", value=str(wrist.path))]
    node = harness.add(IntentEstimatorNode(namespace="cell", parameter_overrides=overrides))
    names = {p.topic_name for p in node.publishers} | {s.topic_name for s in node.subscriptions}
    assert {"/cell/intent/tasks", "/cell/human/wrist", "/diagnostics"} <= names
    assert not {name for name in names if name.startswith(("/intent", "/human"))}


def spoiled(observation, fault):
    message = message_for(DOFS, observation)
    if fault == "not_finite":
        message.pose.pose.position.y = float("nan")
    elif fault == "zero_stamp":
        message.header.stamp = to_stamp(0)
    elif fault == "stamp_not_increasing":
        message.header.stamp = to_stamp(observation.stamp_ns - 500_000_000)
    elif fault == "bad_covariance":
        message.pose.covariance = np.full(36, float("nan"))
    return message


FAULTS = ("not_finite", "zero_stamp", "stamp_not_increasing", "bad_covariance")


@pytest.mark.slow
def test_bad_input_is_counted_and_leaves_the_estimate_alone(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(1)
    for k, observation in enumerate(observations):
        if k % 7 == 3:
            fault = FAULTS[k // 7 % len(FAULTS)]
            before = graph.rejected(fault)
            assert not graph.send(spoiled(observation, fault))
            assert graph.rejected(fault) == before + 1
        if k % 7 == 5:  # a duplicate of the one before
            assert not graph.send(message_for(DOFS, observations[k - 1]))
        assert graph.send(message_for(DOFS, observation))
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)
    counts = {v.key: int(v.value) for v in graph.status().values if v.key.startswith("rejected")}
    assert set(counts) == {f"rejected {fault}" for fault in FAULTS}
    assert min(counts.values()) >= 4


def test_what_cannot_be_computed_is_counted_and_the_movement_forgotten(harness, wrist, monkeypatch):
    graph = Graph(harness, wrist)
    first, *rest = wrist.observations(1)

    def refuse(observation):
        raise ArgumentError("innovation covariance: none")

    with monkeypatch.context() as patch:
        patch.setattr(graph.node.people[""].estimator, "update", refuse)
        assert not graph.send(message_for(graph.dofs, first), first.group)
    assert graph.rejected("not_finite") == 1
    graph.feed(rest)
    check_tasks(graph.tasks, expected(wrist.model, rest), wrist.model.labels)


@pytest.mark.slow
def test_a_message_without_any_joint_is_counted_and_the_rest_goes_on(harness, mixed):
    graph = Graph(harness, mixed)
    observations = mixed.observations(1)
    used = []
    for k, observation in enumerate(observations):
        message = message_for(MIXED, observation)
        lost = observation.group == 1 and k % 2
        if lost:
            message.name, message.position = ["wrist"], [0.0]
        else:
            used.append(observation)
        assert graph.send(message, observation.group) == (not lost)
    assert graph.rejected("missing_dof") == len(observations) - len(used) > 10
    check_tasks(graph.tasks, expected(mixed.model, used), mixed.model.labels)


@pytest.mark.slow
def test_a_publisher_of_another_type_is_reported_once(harness, wrist):
    graph = Graph(harness, wrist)
    context = rclpy.Context()  # one process may not mix the types of a topic in one context
    rclpy.init(args=[], context=context)
    impostor = rclpy.create_node("impostor", context=context)
    try:
        impostor.create_publisher(PoseStamped, "human/wrist", qos.SENSOR)
        harness.spin_until(lambda: graph.rejected("wrong_type"))
        end_s = time.monotonic() + 2.5  # two more reports
        harness.spin_until(lambda: time.monotonic() > end_s)
        assert graph.rejected("wrong_type") == 1
        graph.feed(wrist.observations(0)[:5])
    finally:
        impostor.destroy_node()
        context.try_shutdown()


@pytest.mark.slow
def test_occlusion_in_mid_movement_widens_and_does_not_mislead(harness, wrist):
    graph = Graph(harness, wrist, publish_rate=1000.0)
    observations = wrist.observations(2)
    begin = observations[0].stamp_ns
    gap = (1.0, 1.4)
    seen = [o for o in observations if not gap[0] < (o.stamp_ns - begin) * 1e-9 < gap[1]]
    graph.feed(seen)
    check_tasks(graph.tasks, expected(wrist.model, seen), wrist.model.labels)
    moving = [m for m in graph.tasks if m.position[-1] < 1.0]
    assert np.argmax(moving[-1].position) == 2


@pytest.mark.slow
def test_reset_forgets_the_movement_and_the_clock(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(0)
    graph.feed(observations[:80])
    assert graph.tasks[-1].position[-1] < 1.0
    assert graph.call("reset").success
    del graph.tasks[:], graph.robot[:]
    earlier = shifted(observations, -100.0)  # a recording from before, played again
    graph.feed(earlier)
    check_tasks(graph.tasks, expected(wrist.model, earlier), wrist.model.labels)
    harness.spin_until(lambda: graph.robot)
    assert len(graph.robot) > 10


@pytest.mark.slow
def test_reload_in_mid_movement_loses_no_observation(harness, wrist, tmp_path):
    graph = Graph(harness, wrist)
    observations = wrist.observations(1)
    graph.feed(observations[:80])
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
    tasks = harness.collect(JointState, "intent/tasks", 1000)
    harness.spin_until(lambda: graph.node.people[""].output.tasks.get_subscription_count() == 2)
    observations = wrist.observations(1)
    graph.feed(observations[:70])
    client = harness.probe.create_client(Trigger, "intent_estimator/reload_model")
    harness.spin_until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    for observation in observations[70:]:
        graph.inputs[0].publish(message_for(DOFS, observation))
    harness.spin_until(lambda: future.done() and len(tasks) >= len(observations))
    assert future.result().success
    check_tasks(tasks, expected(wrist.model, observations), wrist.model.labels)


@pytest.mark.slow
def test_a_clock_that_was_set_back_is_followed(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(0, rest_before_s=2.0)
    graph.feed(observations[:160])
    again = shifted(observations, -1000.0)
    late = 0
    while not graph.send(message_for(DOFS, again[late])):
        late += 1
    assert late == CLOCK_RESET_AFTER - 1 == graph.rejected("stamp_not_increasing")
    del graph.tasks[:-1], graph.robot[:]
    graph.feed(again[late + 1 :])
    check_tasks(graph.tasks, expected(wrist.model, again[late:]), wrist.model.labels)
    harness.spin_until(lambda: len(graph.robot) > 10)


@pytest.mark.slow
def test_a_model_of_other_dofs_is_refused_and_the_old_one_kept(harness, wrist, mixed):
    graph = Graph(harness, wrist)
    observations = wrist.observations(1)
    graph.feed(observations[:80])
    for path, word in ((mixed.path, "thumb"), ("/nowhere.npz", "/nowhere.npz"), ("", "model")):
        graph.node.set_parameters([Parameter("model", value=str(path))])
        answer = graph.call("reload_model")
        assert not answer.success and word in answer.message
    graph.feed(observations[80:])
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)


@pytest.mark.slow
def test_a_stream_that_stops_in_a_movement_is_said_and_taken_back(harness, wrist):
    graph = Graph(harness, wrist)
    assert graph.status().message == "waiting for a movement"
    observations = wrist.observations(0)
    graph.feed(observations[:80])
    assert graph.status().level == DiagnosticStatus.OK and graph.status().message == "moving"
    harness.spin_until(lambda: graph.status().level == DiagnosticStatus.WARN)
    assert "human stream stopped" in graph.status().message
    # what cannot be used does not count as the stream's return
    assert not graph.send(spoiled(observations[80], "not_finite"))
    assert graph.status().level == DiagnosticStatus.WARN
    graph.feed(observations[80:82])
    assert graph.status().level == DiagnosticStatus.OK and graph.status().message == "moving"
    assert graph.call("reset").success
    assert graph.status().message == "waiting for a movement"


@pytest.mark.slow
def test_a_stream_too_slow_for_an_onset_is_said_with_topic_and_rates(harness, wrist):
    graph = Graph(harness, wrist)
    resting = wrist.observations(0)
    graph.feed(
        [
            one._replace(stamp_ns=resting[0].stamp_ns + k * 10**9)
            for k, one in enumerate(resting[:3])
        ]
    )
    harness.spin_until(lambda: graph.status().level == DiagnosticStatus.WARN)
    assert "wrist/pose comes at 1 Hz" in graph.status().message
    assert "no movement is found below" in graph.status().message
    assert graph.call("reset").success
    assert graph.status().level == DiagnosticStatus.OK


@pytest.mark.slow
def test_a_stream_does_not_stop_while_simulated_time_stands_still(harness, wrist):
    clock = harness.publisher(Clock, "/clock", qos.STATE)
    graph = Graph(harness, wrist, use_sim_time=True)
    harness.connect(clock)
    clock.publish(Clock(clock=to_stamp(10_000_000_000)))
    harness.spin_until(lambda: graph.node.get_clock().now().nanoseconds)
    graph.feed(wrist.observations(0)[:80])
    end_s = time.monotonic() + 0.8  # longer than the stream may be silent in simulated time
    harness.spin_until(lambda: time.monotonic() > end_s)
    assert graph.status().level == DiagnosticStatus.OK
    clock.publish(Clock(clock=to_stamp(11_000_000_000)))
    harness.spin_until(lambda: graph.status().level == DiagnosticStatus.WARN)


@pytest.mark.slow
def test_inactive_it_is_silent_and_active_again_it_starts_anew(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(0)
    graph.feed(observations[:80])
    graph.node.trigger_deactivate()
    assert not graph.call("reset").success
    assert not graph.call("reload_model").success
    harness.spin_until(lambda: graph.inputs[0].get_subscription_count() == 0)
    assert graph.status().message == "not active"
    graph.node.trigger_activate()
    harness.connect(*graph.inputs)
    del graph.tasks[:]
    graph.feed(observations)
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)


@pytest.mark.slow
def test_it_obeys_the_services_of_a_lifecycle_node(harness, wrist):
    graph = Graph(harness, wrist)
    observations = wrist.observations(2)
    graph.feed(observations[:90])
    for transition, state in (
        (Transition.TRANSITION_DEACTIVATE, "inactive"),
        (Transition.TRANSITION_CLEANUP, "unconfigured"),
        (Transition.TRANSITION_CONFIGURE, "inactive"),
        (Transition.TRANSITION_ACTIVATE, "active"),
    ):
        request = ChangeState.Request(transition=Transition(id=transition))
        assert harness.call(ChangeState, "intent_estimator/change_state", request).success
        answer = harness.call(GetState, "intent_estimator/get_state", GetState.Request())
        assert answer.current_state.label == state
    harness.connect(*graph.inputs)
    del graph.tasks[:]
    graph.feed(observations)
    check_tasks(graph.tasks, expected(wrist.model, observations), wrist.model.labels)


def test_an_activation_that_fails_half_way_leaves_nothing_subscribed(harness, tmp_path):
    gripper = DofEntry("gripper/width", "nowhere_msgs/msg/Width", fields=("width",), unit="m")
    dofs = DofSpec((WRIST,), (ROBOT, gripper))
    path = tmp_path / "m.npz"
    save_model(path, Model(true_library(dofs), dofs))
    given = {"model": str(path), "autostart": False}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    node = harness.add(IntentEstimatorNode(parameter_overrides=overrides))
    before = sorted(subscription.topic_name for subscription in node.subscriptions)
    node.trigger_configure()
    for _ in range(2):
        assert node.trigger_activate() is TransitionCallbackReturn.FAILURE
        assert not node.active
        topics = sorted(subscription.topic_name for subscription in node.subscriptions)
        assert topics == before


def test_it_waits_when_told_to(harness, wrist):
    graph = Graph(harness, wrist, autostart=False)
    assert not graph.node.people[""].inputs.subscriptions
    graph.node.trigger_configure()
    graph.node.trigger_activate()
    harness.connect(*graph.inputs)
    graph.feed(wrist.observations(0)[:30])


@pytest.mark.slow
def test_observed_topics_of_three_kinds_work_together(harness, mixed):
    graph = Graph(harness, mixed)
    observations = mixed.observations(2)
    graph.feed(observations)
    check_tasks(graph.tasks, expected(mixed.model, observations), mixed.model.labels)
    moving = [m for m in graph.tasks if m.position[-1] < 1.0]
    assert np.argmax(moving[-1].position) == 2
    assert graph.robot and graph.path


def test_changed_labels_reach_the_topic(harness, wrist, tmp_path):
    renamed = replace(wrist.model.library, labels=("plate", "screw", "tool"))
    save_model(tmp_path / "m.npz", Model(renamed, DOFS))
    graph = Graph(harness, wrist)
    graph.node.set_parameters([Parameter("model", value=str(tmp_path / "m.npz"))])
    assert graph.call("reload_model").success
    graph.feed(wrist.observations(0)[:3])
    assert list(graph.tasks[-1].name) == ["plate", "screw", "tool", NONE]


@pytest.mark.slow
def test_trajectories_are_published_without_listeners_to_path_and_markers(harness, wrist):
    graph = Graph(harness, wrist, listen=False)
    graph.feed(wrist.observations(0))
    assert len(graph.robot) > 10

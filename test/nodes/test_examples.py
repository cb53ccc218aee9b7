# SPDX-License-Identifier: Apache-2.0
"""The example configurations: bags recorded with them train, and the nodes run with them."""

from typing import NamedTuple

import numpy as np
import pytest
from model_builder import perform, true_library, write_recording
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import load_dofs, read_demonstrations, settle_orientations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import message_class, stamp_ns
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.share import share_path


class Example(NamedTuple):
    """A DOF file, the parameters that go with it, and the namespace of the sender's topics."""

    dofs: str
    params: str = ""
    sender: str = ""


EXAMPLES = {
    "two hands of vrpn_mocap": Example(
        "config/examples/two_hands.dofs.yaml", "config/examples/two_hands.params.yaml", "mocap"
    ),
    "joints of an exoskeleton": Example("config/examples/joint_states.dofs.yaml"),
    "a second human": Example(
        "config/dofs_two_humans.yaml", "config/examples/second_human.params.yaml"
    ),
    "a skeleton as PoseArray": Example("config/examples/pose_array.dofs.yaml"),
    "a skeleton as MarkerArray": Example("config/examples/marker_array.dofs.yaml"),
    "a body of REP 155": Example("config/examples/ros4hri.dofs.yaml"),
    "whole poses": Example(
        "config/examples/whole_pose.dofs.yaml", "config/examples/second_human.params.yaml"
    ),
    "a frame of tf": Example("config/examples/tf.dofs.yaml"),
}


class Trained(NamedTuple):
    """A model learned from bags of an example, and a bag it has not seen."""

    example: Example
    model: str
    bag: str


@pytest.fixture(scope="module", params=EXAMPLES)
def trained(request, tmp_path_factory):
    example = EXAMPLES[request.param]
    folder = tmp_path_factory.mktemp("example")
    dofs = load_dofs(share_path(example.dofs))
    for entry in dofs.observed:
        pytest.importorskip(entry.type.partition("/")[0], reason="its messages are not installed")
    truth = true_library(dofs, n_tasks=2)
    for i in range(4 * truth.n_tasks):
        recording = perform(truth, i % truth.n_tasks, i)
        write_recording(folder / "bags" / recording.name, recording, dofs)
    settled = settle_orientations(dofs, folder / "bags")
    demonstrations, rejections = read_demonstrations([folder / "bags"], settled)
    assert not rejections
    library = learn(
        demonstrations, TrainingSettings(n_basis=10, n_aligned_basis=10, switching=False)
    )
    save_model(folder / "m.npz", Model(library, settled))
    bag = write_recording(folder / "unseen", perform(truth, 1, 90, rate_hz=25.0), dofs)
    return Trained(example, str(folder / "m.npz"), bag)


def make(harness, kind, params="", **values):
    """A node with the example's parameter file, as `ros2 run` would start it."""
    words = ["--ros-args", "--params-file", str(share_path(params))] if params else []
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return harness.add(kind(cli_args=words, parameter_overrides=overrides))


class Sender:
    """A bridge, or a suit: publishes what was recorded, as sensor data, under its own namespace."""

    def __init__(self, harness, example, dofs):
        node = harness.add(Node("client_node", namespace=f"/{example.sender}"))
        self.types = {e.topic: message_class(e.type) for e in (*dofs.observed, *dofs.controlled)}
        self.inputs = {
            topic: node.create_publisher(kind, topic.removeprefix(f"{example.sender}/"), qos.SENSOR)
            if example.sender and topic.startswith(example.sender)
            else harness.publisher(kind, topic, qos.SENSOR)
            for topic, kind in self.types.items()
        }

    def send(self, raw):
        topic = raw.topic.lstrip("/")
        self.inputs[topic].publish(deserialize_message(raw.data, self.types[topic]))


@pytest.mark.slow
def test_nodes_recognise_and_predict_with_the_example(harness, trained):
    model, example = load_model(trained.model), trained.example
    poses = "PoseStamped" in model.dofs.observed[0].type
    ingest = make(harness, MocapIngest, example.params) if poses else None
    estimator = make(harness, IntentEstimatorNode, model=trained.model)
    sender = Sender(harness, example, model.dofs)
    tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
    predictions = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
    harness.connect(
        *sender.inputs.values(),
        estimator.people[""].output.tasks,
        estimator.people[""].output.trajectory,
    )
    if ingest is not None:
        harness.connect(*ingest._outputs.values())
    observed = {entry.topic for entry in model.dofs.observed}
    sent, heard = 0, estimator._diagnostics._totals
    for raw in BagReader(trained.bag).raw_messages(sender.inputs):
        sender.send(raw)
        if raw.topic.lstrip("/") in observed:
            sent += sum(e.topic == raw.topic.lstrip("/") for e in model.dofs.observed)
            harness.spin_until(lambda n=sent: len(tasks) >= n, what="its effect")
        else:
            topic = raw.topic.lstrip("/")
            before = heard[topic]
            harness.spin_until(lambda t=topic, n=before: heard[t] > n, what="the posture")
    rows = list(replay(BagReader(trained.bag), model))
    assert [stamp_ns(message) for message in tasks] == [row["stamp"] for row in rows]
    for message, row in zip(tasks, rows, strict=True):
        np.testing.assert_allclose(
            message.position, list(row["probabilities"].values()), rtol=0.0, atol=1e-9
        )
    moving = [row["probabilities"] for row in rows if row["probabilities"]["none"] < 1.0]
    assert max(moving[-1], key=moving[-1].get) == "task_1"
    assert tuple(predictions[-1].joint_names) == model.dofs.controlled_message_names
    assert predictions[-1].header.frame_id == "task_1"
    nodes = [estimator] + [ingest] * poses
    rejected = {reason for node in nodes for reason in node._diagnostics._counts}
    assert rejected <= {"start_posture_unknown", "start_posture_outside"}


ELSEWHERE = {
    *("boxes.params.yaml", "cell_plan.yaml", "link_pose.dofs.yaml", "toolbox_sequence.yaml"),
    *("moved_box.dofs.yaml", "wrench.dofs.yaml"),
}
"""Examples that other tests use."""


def test_every_example_is_tested():
    found = {p.name for p in share_path("config/examples").iterdir()}
    used = [path for e in EXAMPLES.values() for path in (e.dofs, e.params)]
    assert found == {path.rpartition("/")[2] for path in used if "examples" in path} | {*ELSEWHERE}

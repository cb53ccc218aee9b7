# SPDX-License-Identifier: Apache-2.0
"""The example configurations: bags recorded with them train, and the nodes run with them."""

from pathlib import Path
from typing import NamedTuple

import pytest
from model_builder import perform, true_library, write_recording
from nodes.test_observing import Nodes, check_replay, winner
from rclpy.qos import QoSReliabilityPolicy

from intent_recognition.demonstrations import (
    DofSpec,
    load_dofs,
    read_demonstrations,
    settle_orientations,
)
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.nodes.mocap_ingest import MocapIngest
from intent_recognition.share import share_path


class Example(NamedTuple):
    """A DOF file, and the parameters that go with it."""

    dofs: str
    params: str = ""


EXAMPLES = {
    "two hands of vrpn_mocap": Example(
        "config/examples/two_hands.dofs.yaml", "config/examples/two_hands.params.yaml"
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
    path: Path
    dofs: DofSpec
    bag: Path


@pytest.fixture(scope="module", params=EXAMPLES)
def trained(request, tmp_path_factory):
    example = EXAMPLES[request.param]
    folder = tmp_path_factory.mktemp("example")
    dofs = load_dofs(share_path(example.dofs))
    for entry in dofs.observed:
        pytest.importorskip(entry.type.partition("/")[0], reason="its messages are not installed")
    truth = true_library(dofs, n_tasks=2)
    for i in range(3 * truth.n_tasks):
        recording = perform(truth, i % truth.n_tasks, i, rate_hz=25.0)
        write_recording(folder / "bags" / recording.name, recording, dofs)
    settled = settle_orientations(dofs, folder / "bags")
    demonstrations, rejections = read_demonstrations([folder / "bags"], settled)
    assert not rejections
    library = learn(
        demonstrations, TrainingSettings(n_basis=10, n_aligned_basis=10, switching=False)
    )
    save_model(folder / "m.npz", Model(library, settled))
    bag = write_recording(folder / "unseen", perform(truth, 1, 90, rate_hz=25.0), dofs)
    return Trained(example, folder / "m.npz", settled, bag)


@pytest.mark.slow
def test_nodes_recognise_and_predict_with_the_example(harness, trained):
    params = trained.example.params
    words = ["--ros-args", "--params-file", str(share_path(params))] if params else []
    ingest = harness.add(MocapIngest(cli_args=words))
    nodes = Nodes(harness, trained, ingest, model=str(trained.path))
    predictions = harness.said(nodes.estimator, "intent/robot_trajectory")
    nodes.feed(trained.bag)
    rows = check_replay(nodes, trained.bag, load_model(trained.path))
    assert winner(rows) == "task_1"
    assert tuple(predictions[-1].joint_names) == trained.dofs.controlled_message_names
    assert predictions[-1].header.frame_id == "task_1"
    inputs = {entry.topic for entry in trained.dofs.observed}
    heard = [s for s in nodes.estimator.subscriptions if s.topic_name.lstrip("/") in inputs]
    offers = {s.qos_profile.reliability for s in heard}
    assert offers <= {QoSReliabilityPolicy.BEST_EFFORT}  # which hears all senders


ELSEWHERE = {
    *("boxes.params.yaml", "cell_plan.yaml", "link_pose.dofs.yaml", "toolbox_sequence.yaml"),
    *("moved_box.dofs.yaml", "wrench.dofs.yaml"),
}
"""Examples that other tests use."""


def test_every_example_is_tested():
    found = {p.name for p in share_path("config/examples").iterdir()}
    used = [path for e in EXAMPLES.values() for path in (e.dofs, e.params)]
    assert found == {path.rpartition("/")[2] for path in used if "examples" in path} | {*ELSEWHERE}

# SPDX-License-Identifier: Apache-2.0
"""Real people: recordings that were not learned from are played to the running nodes."""

from functools import partial

import numpy as np
import pytest
from sensor_msgs.msg import JointState
from system.pacing import PacedPlayer
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest

pytestmark = pytest.mark.slow

LEFT_OUT = ("demo_0003", "demo_0014", "demo_0022", "demo_0035")
RATE = 4.0
LONG_S = 300.0


@pytest.fixture(scope="module")
def learned(shared_data, tmp_path_factory):
    """People with the YuMi arm: the folder, and a model of all but one recording of each task."""
    folder = shared_data / "hri_yumi"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    dofs = load_dofs(folder / "dofs.yaml")
    demonstrations, rejections = read_demonstrations(folder, dofs)
    assert len(demonstrations) == 28 and not rejections
    library = learn([d for d in demonstrations if d.name not in LEFT_OUT], TrainingSettings())
    path = tmp_path_factory.mktemp("people") / "model.npz"
    save_model(path, Model(library, dofs))
    return folder, dofs, path


@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_person_never_seen_in_training_is_recognised(harness, learned, name):
    folder, dofs, model = learned
    task = BagReader(folder / name).custom_data["task"]

    ingest = harness.node(MocapIngest)
    estimator = harness.node(IntentEstimatorNode, model=str(model))
    tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
    robot = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
    kind = partial(PacedPlayer, {e.topic for e in dofs.observed}, ingest, estimator)
    player = harness.node(kind, bag=str(folder / name), rate=RATE)
    harness.spin_until(lambda: player.done, LONG_S, "the end of the recording")
    end_ns = BagReader(folder / name).end_ns
    harness.spin_until(lambda: stamp_ns(tasks[-1]) > end_ns - 500_000_000, what="the last tasks")

    moving = [message for message in tasks if any(message.effort)]
    leaders = [message.name[int(np.argmax(message.position))] for message in moving]
    late = leaders[len(leaders) // 2 :]
    assert late and late.count(task) > 0.9 * len(late)
    of_task = [message for message in robot if message.header.frame_id == task]
    assert of_task
    for message in of_task:
        assert list(message.joint_names) == [f"yumi_joint_{k}" for k in range(1, 8)]
        times, positions, rest = trajectory_arrays(message)
        assert positions.shape == (50, 7) and np.all(np.diff(times) > 0)
        assert np.all(np.isfinite(positions)) and np.all(rest["effort"] > 0)

# SPDX-License-Identifier: Apache-2.0
"""A DOF file of several observed topics of different types, from bags to the running node."""

from functools import partial

import numpy as np
import pytest
from model_builder import GLOVE, TOOL, WRIST, make_dofs, perform, true_library, write_recording
from sensor_msgs.msg import JointState
from system.pacing import PacedPlayer
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags.reader import BagReader
from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.evaluation.replaying import replay
from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest

pytestmark = pytest.mark.slow

MIXTURES = {
    "wrist and glove": make_dofs(WRIST, GLOVE),
    "glove alone": make_dofs(GLOVE),
    "tool, glove and wrist": make_dofs(TOOL, GLOVE, WRIST),
}
PER_TASK = 6
LONG_S = 300.0


def train(folder, dofs, truth):
    """Bags written, read and learned from; the model file."""
    for k in range(PER_TASK * truth.n_tasks):
        write_recording(folder / "bags" / f"demo_{k:02d}", perform(truth, k % 3, k), dofs)
    demonstrations, rejections = read_demonstrations(folder / "bags", dofs)
    assert not rejections
    library = learn(demonstrations, TrainingSettings(n_basis=10))
    save_model(folder / "model.npz", Model(library, dofs))
    return folder / "model.npz"


def start(harness, kind, **parameters):
    return harness.node(kind, **parameters)


@pytest.mark.parametrize("mixture", MIXTURES)
def test_any_mixture_of_observed_topics(harness, tmp_path, mixture):
    dofs = MIXTURES[mixture]
    truth = true_library(dofs)
    model = train(tmp_path, dofs, truth)
    bag = write_recording(tmp_path / "test", perform(truth, 1, 70), dofs)
    ingest = start(harness, MocapIngest)
    estimator = start(harness, IntentEstimatorNode, model=str(model))
    tasks = harness.collect(JointState, "intent/tasks", qos.STATE)
    robot = harness.collect(JointTrajectory, "intent/robot_trajectory", qos.COMMAND)
    kind = partial(PacedPlayer, {e.topic for e in dofs.observed}, ingest, estimator)
    player = start(harness, kind, bag=str(bag), rate=2.0)
    end_ns = BagReader(bag).end_ns
    harness.spin_until(lambda: player.done, LONG_S, "the end of the bag")
    harness.spin_until(lambda: tasks and stamp_ns(tasks[-1]) > end_ns - 500_000_000, what="tasks")

    moving = [message for message in tasks if any(message.effort)]
    assert moving[-1].name[int(np.argmax(moving[-1].position))] == "task_1"
    assert robot and robot[-1].header.frame_id == "task_1"
    active = [row["active_task"] for row in replay(BagReader(bag), load_model(model))]
    assert active[0] == active[-1] == "" and [a for a in active if a][-1] == "task_1"

# SPDX-License-Identifier: Apache-2.0
"""The estimator node, what it is told and says, and what the library says."""

from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped
from model_builder import GLOVE, TOOL, WRIST, learned_model, make_dofs, perform, true_library
from nav_msgs.msg import Odometry

from intent_recognition.model.file import Model, save_model
from intent_recognition.nodes.conversions import stamp_ns, to_joint_state, to_pose, to_stamp
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.promp import NONE
from intent_recognition.recognition.estimator import IntentEstimator
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
    """The node, what it is told, and what it says on its topics."""

    def __init__(self, harness, folder, *, listen=True, **parameters):
        self.harness, self.dofs, self.model = harness, folder.dofs, folder.model
        self.node = harness.node(IntentEstimatorNode, **{"model": str(folder.path), **parameters})
        said = partial(harness.said, self.node)
        self.tasks, self.robot = said("intent/tasks"), said("intent/robot_trajectory")
        if listen:
            self.path, self.markers = said("intent/human_path"), said("intent/markers")

    def send(self, message, group=0):
        """Let the node take a message; whether it was accepted."""
        accepted, entry = len(self.tasks), self.dofs.observed[group]
        topic = "human/wrist" if entry == WRIST else entry.topic
        self.harness.hear(self.node, topic, message)
        return len(self.tasks) > accepted

    def feed(self, observations):
        for observation in observations:
            message = message_for(self.dofs, observation)
            assert self.send(message, observation.group), observation

    def rejected(self, reason):
        return self.node._diagnostics.rejected(reason)

    def status(self):
        return self.node._diagnostics.report()

    def call(self, service):
        return self.harness.trigger(f"intent_estimator/{service}")


def expected(model: Model, observations) -> list:
    estimator = IntentEstimator(model.library)
    return [estimator.update(observation) for observation in observations]


def predictions_of(library, observations, posture=None) -> list:
    """What is predicted after each of them, of an arm that waits in a posture."""
    estimator, found = IntentEstimator(library), []
    for observation in observations:
        estimator.update(observation)
        found.append(estimator.predict_controlled())
        if posture is not None:
            estimator.update_controlled(Observation(observation.stamp_ns, 0, posture))
    return [prediction for prediction in found if prediction is not None]


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

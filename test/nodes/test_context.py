# SPDX-License-Identifier: Apache-2.0
"""What the estimator is told beside its observations: places of the scene, and via points."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, Graph, check_tasks, message_for, with_covariance
from geometry_msgs.msg import PoseStamped
from kinematics.robots import lwr_urdf
from moved_box import DOFS as BOX_DOFS
from moved_box import hand_over, learned
from rclpy.parameter import Parameter
from simulation import START_NS
from std_msgs.msg import String

from intent_recognition.composing import read_via_points, write_via_points
from intent_recognition.model import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose, to_stamp, trajectory_arrays
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.promp import controlled_at
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Observation, merge

PLACE, ELSEWHERE = np.array([0.2, -0.15]), np.array([-0.1, 0.2])


@pytest.fixture(scope="module")
def box_folder(tmp_path_factory):
    """The model on disk."""
    model, path = Model(learned().library, BOX_DOFS), tmp_path_factory.mktemp("box") / "model.npz"
    save_model(path, model)
    return SimpleNamespace(dofs=BOX_DOFS, model=model, path=path)


def pose(place, stamp_ns):
    message = PoseStamped(pose=to_pose(np.r_[place, 0.0], (0.0, 0.0, 0.0, 1.0)))
    message.header.stamp = to_stamp(stamp_ns)
    message.header.frame_id = "box"
    return message


def observations(seed=300):
    return list(merge(hand_over("give", seed, box=PLACE).observed))


@pytest.mark.slow
@pytest.mark.parametrize("profile", [qos.LATCHED, qos.SENSOR])
def test_a_context_counts_from_when_it_comes(harness, box_folder, profile):
    """Latched, the first was said before the node started; else it comes late. Then it changes."""
    latched, box = profile is qos.LATCHED, harness.publisher(PoseStamped, "box/pose", profile)
    if latched:
        box.publish(pose(ELSEWHERE, START_NS - 10**9))
    graph = Graph(harness, box_folder, listen=False)
    harness.connect(box, subscribers=2 if latched else 1)
    estimator, expected = IntentEstimator(box_folder.model.library), []
    heard = graph.node._diagnostics._totals
    if latched:
        harness.spin_until(lambda: heard["box/pose"], what="the latched place")
        estimator.update_context(Observation(START_NS - 10**9, 0, ELSEWHERE))
    for number, observation in enumerate(observations()):
        if number == 60:
            due = heard["box/pose"] + 1 + latched
            box.publish(pose(PLACE, observation.stamp_ns))
            harness.spin_until(lambda due=due: heard["box/pose"] >= due, what="the place")
            estimator.update_context(Observation(observation.stamp_ns, 0, PLACE))
        assert graph.send(message_for(BOX_DOFS, observation))
        expected.append(estimator.update(with_covariance(BOX_DOFS, observation)))
    check_tasks(graph.tasks, expected, box_folder.model.labels)
    assert graph.node.people[""].inputs.frame == "world"
    end = estimator.predict_controlled()
    assert end is None or graph.robot


def test_a_context_that_cannot_be_read_is_counted(harness, box_folder):
    graph = Graph(harness, box_folder, listen=False)
    for place, after_ns in (([np.inf, 0.0], 0), (PLACE, 5), (PLACE, 3)):
        harness.hear(graph.node, "box/pose", pose(place, START_NS + after_ns))
    assert graph.node._diagnostics._counts == {"not_finite": 1, "stamp_not_increasing": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("via"), DOFS)


@pytest.mark.slow
def test_the_path_passes_until_the_point_is_removed(harness, folder):
    graph = Graph(harness, folder)
    told = harness.said(graph.node, "intent/via_points")

    def put(*points):
        text = write_via_points(read_via_points(json.dumps(points)))
        (result,) = graph.node.set_parameters([Parameter("via_points", value=text)])
        return result.reason

    library = folder.model.library
    at = controlled_at(library, 0, 1.0)
    goal = float(at.mean[3] + 3.0 * np.sqrt(at.covariance[3, 3]))
    task = library.labels[0]
    end = {"name": "end", "task": task, "phase": 1.0, "std": 1e-4}
    point = end | {"dofs": {"lwr_a4_joint": goal}}
    assert put(point) == ""
    assert read_via_points(told[-1].data) == read_via_points(json.dumps([point]))
    assert "DOFs of lwr_a1_joint" in put(end | {"dofs": {"elbow": 1.0}})
    graph.feed(folder.observations(task=0)[:100])
    found = graph.robot[-1]
    assert found.header.frame_id == task
    assert abs(trajectory_arrays(found)[1][-1, 3] - goal) < 1e-3
    assert put() == ""
    assert told[-1].data == ""
    assert graph.node.people[""].estimator.library is graph.node._model.library


def test_given_at_the_start_a_point_of_the_hand_waits_for_the_arm(harness, folder):
    far = "[{name: far, task: task_0, phase: 0.5, hand: [3, 0, 0.5]}]"
    node = harness.node(IntentEstimatorNode, model=str(folder.path), via_points=far)
    told = harness.said(node, "intent/via_points")
    node._check_stream()
    assert told == [] and node._diagnostics.rejected("bad_via_points") == 0
    harness.hear(node, "robot_description", String(data=lwr_urdf()))
    node._check_stream()
    assert told[-1].data == "" and node._diagnostics.rejected("bad_via_points") == 1

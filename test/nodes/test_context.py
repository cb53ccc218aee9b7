# SPDX-License-Identifier: Apache-2.0
"""What the estimator is told beside its observations: places of the scene, and via points."""

import json

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


class BoxFolder:
    """The model on disk."""

    def __init__(self, folder):
        self.dofs, self.model = BOX_DOFS, Model(learned().library, BOX_DOFS)
        self.path = folder / "model.npz"
        save_model(self.path, self.model)


@pytest.fixture(scope="module")
def box_folder(tmp_path_factory):
    return BoxFolder(tmp_path_factory.mktemp("context"))


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
    latched = profile is qos.LATCHED
    box = harness.publisher(PoseStamped, "box/pose", profile)
    if latched:
        box.publish(pose(ELSEWHERE, START_NS - 10**9))
    graph = Graph(harness, box_folder, listen=False)
    harness.connect(box, subscribers=2 if latched else 1)
    estimator, expected = IntentEstimator(box_folder.model.library), []
    if latched:
        harness.spin_until(lambda: heard(graph) > 0, what="the latched place")
        estimator.update_context(Observation(START_NS - 10**9, 0, ELSEWHERE))
    for number, observation in enumerate(observations()):
        if number == 60:
            due = heard(graph) + 1 + latched
            box.publish(pose(PLACE, observation.stamp_ns))
            harness.spin_until(lambda due=due: heard(graph) >= due, what="the place")
            estimator.update_context(Observation(observation.stamp_ns, 0, PLACE))
        assert graph.send(message_for(BOX_DOFS, observation))
        expected.append(estimator.update(with_covariance(BOX_DOFS, observation)))
    check_tasks(graph.tasks, expected, box_folder.model.labels)
    assert graph.node.people[""].inputs.frame == "world"
    end = estimator.predict_controlled()
    assert end is None or graph.robot


def test_a_context_that_cannot_be_read_is_counted(harness, box_folder):
    box = harness.publisher(PoseStamped, "box/pose", qos.STATE)
    graph = Graph(harness, box_folder, listen=False)
    harness.connect(box)
    box.publish(pose([np.inf, 0.0], START_NS))
    harness.spin_until(lambda: graph.rejected("not_finite"), what="a count")
    box.publish(pose(PLACE, START_NS + 5))
    box.publish(pose(PLACE, START_NS + 3))
    harness.spin_until(lambda: graph.rejected("stamp_not_increasing"), what="a count")


def heard(graph):
    return graph.node._diagnostics._totals["box/pose"]


def test_what_is_left_over_from_a_pass_before_does_not_hold_up_the_next(harness, box_folder):
    box = harness.publisher(PoseStamped, "box/pose", qos.STATE)
    graph = Graph(harness, box_folder, listen=False)
    harness.connect(box)
    for at_s, place in ((10, ELSEWHERE), (11, ELSEWHERE), (2, PLACE)):
        if at_s == 11:
            graph.node._start_over()  # as when /clock goes back
        harness.tell(graph.node, box, pose(place, START_NS + at_s * 10**9))
    assert graph.rejected("left_over") == 1 and graph.rejected("stamp_not_increasing") == 0
    np.testing.assert_array_equal(graph.node.people[""].estimator._context.values, PLACE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("via"), DOFS)


@pytest.mark.slow
def test_the_path_passes_until_the_point_is_removed(harness, folder):
    told = harness.collect(String, "intent/via_points", qos.LATCHED)
    graph = Graph(harness, folder)
    harness.spin_until(lambda: told, what="that there are none")
    assert told[-1].data == ""

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
    harness.spin_until(lambda: told[-1].data, what="the point")
    assert read_via_points(told[-1].data) == read_via_points(json.dumps([point]))
    for refused, text in (
        (end | {"dofs": {"lwr_a4_joint": 2.0}}, "end: expected at most 6 standard"),
        (end | {"dofs": {"elbow": 1.0}}, "DOFs of lwr_a1_joint"),
        ({"name": "far", "hand": [0.3, 0.0, 0.5], "phase": 0.5}, "no robot_description"),
    ):
        assert text in put(refused)
    graph.feed(folder.observations(task=0)[:100])
    harness.spin_until(lambda: graph.robot, what="a trajectory")
    found = graph.robot[-1]
    assert found.header.frame_id == task
    assert abs(trajectory_arrays(found)[1][-1, 3] - goal) < 1e-3
    assert put() == ""
    harness.spin_until(lambda: not told[-1].data, what="that it is removed")
    assert graph.node.people[""].estimator.library is graph.node._model.library


def test_given_at_the_start_a_point_of_the_hand_waits_for_the_arm(harness, folder):
    told = harness.collect(String, "intent/via_points", qos.LATCHED)
    far = "[{name: far, task: task_0, phase: 0.5, hand: [3, 0, 0.5]}]"
    node = harness.node(IntentEstimatorNode, model=str(folder.path), via_points=far)
    arm = harness.publisher(String, "robot_description", qos.LATCHED)
    harness.spin_until(lambda: node.active, what="an active node")
    assert told == [] and node._diagnostics.rejected("bad_via_points") == 0
    arm.publish(String(data=lwr_urdf()))
    harness.spin_until(lambda: node._diagnostics.rejected("bad_via_points"), what="a count")
    harness.spin_until(lambda: told, what="what is in force")
    assert told[-1].data == ""

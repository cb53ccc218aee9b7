# SPDX-License-Identifier: Apache-2.0
"""The estimator node with a topic of the scene: said before it started, late, and again."""

import numpy as np
import pytest
from estimator_graph import Graph, check_tasks, message_for, with_covariance
from geometry_msgs.msg import PoseStamped
from moved_box import DOFS, hand_over, learned
from simulation import START_NS

from intent_recognition.model import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose, to_stamp
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Observation, merge

PLACE, ELSEWHERE = np.array([0.2, -0.15]), np.array([-0.1, 0.2])


class Folder:
    """The model on disk."""

    def __init__(self, folder):
        self.dofs, self.model = DOFS, Model(learned().library, DOFS)
        self.path = folder / "model.npz"
        save_model(self.path, self.model)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("context"))


def pose(place, stamp_ns):
    message = PoseStamped(pose=to_pose(np.r_[place, 0.0], (0.0, 0.0, 0.0, 1.0)))
    message.header.stamp = to_stamp(stamp_ns)
    message.header.frame_id = "box"
    return message


def observations(seed=300):
    return list(merge(hand_over("give", seed, box=PLACE).observed))


@pytest.mark.slow
@pytest.mark.parametrize("profile", [qos.LATCHED, qos.SENSOR])
def test_a_context_counts_from_when_it_comes(harness, folder, profile):
    """Latched, the first was said before the node started; else it comes late. Then it changes."""
    latched = profile is qos.LATCHED
    box = harness.publisher(PoseStamped, "box/pose", profile)
    if latched:
        box.publish(pose(ELSEWHERE, START_NS - 10**9))
    graph = Graph(harness, folder, listen=False)
    harness.connect(box, subscribers=2 if latched else 1)
    estimator, expected = IntentEstimator(folder.model.library), []
    if latched:
        harness.spin_until(lambda: heard(graph) > 0, what="the latched place")
        estimator.update_context(Observation(START_NS - 10**9, 0, ELSEWHERE))
    for number, observation in enumerate(observations()):
        if number == 60:
            due = heard(graph) + 1 + latched
            box.publish(pose(PLACE, observation.stamp_ns))
            harness.spin_until(lambda due=due: heard(graph) >= due, what="the place")
            estimator.update_context(Observation(observation.stamp_ns, 0, PLACE))
        assert graph.send(message_for(DOFS, observation))
        expected.append(estimator.update(with_covariance(DOFS, observation)))
    check_tasks(graph.tasks, expected, folder.model.labels)
    assert graph.node.people[""].inputs.frame == "world"
    end = estimator.predict_controlled()
    assert end is None or graph.robot


def test_a_context_that_cannot_be_read_is_counted(harness, folder):
    box = harness.publisher(PoseStamped, "box/pose", qos.STATE)
    graph = Graph(harness, folder, listen=False)
    harness.connect(box)
    box.publish(pose([np.inf, 0.0], START_NS))
    harness.spin_until(lambda: graph.rejected("not_finite"), what="a count")
    box.publish(pose(PLACE, START_NS + 5))
    box.publish(pose(PLACE, START_NS + 3))
    harness.spin_until(lambda: graph.rejected("stamp_not_increasing"), what="a count")


def heard(graph):
    return graph.node._diagnostics._totals["box/pose"]


def test_what_is_left_over_from_a_pass_before_does_not_hold_up_the_next(harness, folder):
    box = harness.publisher(PoseStamped, "box/pose", qos.STATE)
    graph = Graph(harness, folder, listen=False)
    harness.connect(box)
    for at_s, place in ((10, ELSEWHERE), (11, ELSEWHERE), (2, PLACE)):
        if at_s == 11:
            graph.node._start_over()  # as when /clock goes back
        harness.tell(graph.node, box, pose(place, START_NS + at_s * 10**9))
    assert graph.rejected("left_over") == 1 and graph.rejected("stamp_not_increasing") == 0
    np.testing.assert_array_equal(graph.node.people[""].estimator._context.values, PLACE)

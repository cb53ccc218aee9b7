# SPDX-License-Identifier: Apache-2.0
"""What the estimator node shows of the human: path, tube and markers."""

import numpy as np
import pytest
from estimator_graph import DOFS, Folder, Graph
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker

from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import stamp_ns, trajectory_arrays
from intent_recognition.nodes.intent_output import MarkerBuilder, colour
from intent_recognition.report.drawing import task_colours


@pytest.fixture(scope="module")
def wrist(tmp_path_factory):
    return Folder(tmp_path_factory.mktemp("wrist"), DOFS)


def check_markers(graph, wrist, observations):
    """Observed and predicted path, tube and label."""
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


@pytest.mark.slow
def test_the_predicted_path_of_the_human_its_tube_and_its_markers(harness, wrist):
    graph = Graph(harness, wrist)
    told = harness.collect(JointTrajectory, "intent/human_trajectory", qos.COMMAND)
    harness.connect(graph.node.people[""].output.human_trajectory)
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
    check_markers(graph, wrist, observations)
    message = told[len(told) // 2]
    assert tuple(message.joint_names) == wrist.model.library.observed_names
    times_s, positions, rest = trajectory_arrays(message)
    assert np.all(np.diff(times_s) > 0.0) and np.all(rest["effort"] > 0.0)
    assert message.header.frame_id == wrist.model.labels[0]
    np.testing.assert_allclose(positions[-1], end, atol=4.0 * rest["effort"][-1].max())


def test_markers_keep_the_colour_of_a_task_when_another_is_learned():
    builder = MarkerBuilder(["plate"])
    builder.set_labels(["apple", "plate"])
    path = np.zeros((2, 3))
    _, plate, _, _ = builder.build(0, "world", "plate", 1.0, path, path).markers
    _, apple, _, _ = builder.build(0, "world", "apple", 1.0, path, path).markers
    assert plate.color == colour(task_colours(["plate"])["plate"])
    assert apple.color != plate.color

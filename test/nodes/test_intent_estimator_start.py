# SPDX-License-Identifier: Apache-2.0
"""The estimator's start, and the frames that its poses come in."""

import re
from dataclasses import replace
from itertools import count
from unittest.mock import Mock, call

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from model_builder import GLOVE, TOOL, WRIST, make_dofs, true_library
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.demonstrations.dofs import DofEntry
from intent_recognition.model import FRAMES, Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_stamp
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode, main
from intent_recognition.nodes.observation_input import ObservationInput, human_topic

DOFS = make_dofs(WRIST, GLOVE)


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "model.npz"
    save_model(path, Model(true_library(DOFS), DOFS))
    return path


def start(capfd, **parameters) -> str:
    """Start the node in this process; the one line it ends with."""
    words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
    assert main(["intent_estimator", "--ros-args", *words]) == 1
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"model": None}, "parameter model.*intent train"),
        ({"model": "/no.file"}, "/no.file"),
        ({"dofs": "/no.file"}, "/no.file"),
        *(({"publish_rate": rate}, "publish_rate") for rate in ("0.0", "-1.0", ".nan")),
    ],
)
def test_parameters_with_which_nothing_can_start(capfd, model, parameters, said):
    given = {"model": model, **parameters}
    given = {name: value for name, value in given.items() if value is not None}
    assert re.search(said, start(capfd, **given))


def test_why_it_cannot_start_is_logged_under_the_name_it_was_given(capfd):
    words = ("-r", "__node:=recognition", "-r", "__ns:=/cell1")
    assert main(["intent_estimator", "--ros-args", *words]) == 1
    (line,) = capfd.readouterr().err.splitlines()
    assert "[FATAL]" in line and "[cell1.recognition]" in line and "-p model:=" in line


def test_a_dof_file_of_other_dofs_is_refused(capfd, model, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(make_dofs(WRIST).to_dict()))
    assert "mine.yaml: observed" in start(capfd, model=model, dofs=path)


def test_who_listens_later_hears_that_nothing_is_expected_and_no_point_is_in_force(harness, model):
    harness.node(IntentEstimatorNode, model=str(model))
    expected = harness.collect(JointState, "intent/next_task", qos.LATCHED)
    points = harness.collect(String, "intent/via_points", qos.LATCHED)
    harness.spin_until(lambda: expected and points, what="both")
    assert expected[0].header.frame_id == points[0].data == ""
    np.testing.assert_allclose(expected[0].position, 1 / len(expected[0].name))


def test_it_listens_to_what_ingest_makes_of_a_raw_pose():
    assert human_topic(WRIST) == "human/wrist"
    cell = DofEntry("cell/mocap/elbow/pose", WRIST.type, fields=WRIST.fields, unit="m")
    assert human_topic(cell) == "cell/human/elbow"


@pytest.mark.parametrize(
    ("learned", "frames", "warned", "counted"),
    [
        (("optitrack",), ("optitrack", "/optitrack", ""), "", 0),
        (("optitrack",), ("world", "world", "cell"), "'optitrack', got 'world'", 3),
        (("optitrack", "world"), ("world",), "'optitrack' and 'world', got 'world'", 1),
        ((), ("world", "optitrack"), "", 0),
    ],
)
def test_another_frame_is_told_once_and_counted(learned, frames, warned, counted):
    node, diagnostics = Mock(), Mock()
    inputs = ObservationInput(node, diagnostics, Mock(), Mock())
    inputs.learned_in({WRIST.topic: learned})
    for frame in frames:
        inputs._note_frame(WRIST.topic, frame)
    warnings = [one.args[0] for one in node.get_logger().warning.mock_calls]
    assert len(warnings) == bool(warned)
    assert all(word in text for text in warnings for word in (warned, WRIST.topic, "extrinsics"))
    assert diagnostics.tick.mock_calls == [call(f"{WRIST.topic}, in another frame")] * counted


def test_the_frames_are_those_of_the_model_also_of_one_that_is_loaded_again(harness, tmp_path):
    dofs, path, sent = make_dofs(WRIST, TOOL), tmp_path / "m.npz", count(1)

    def save(frames):
        library = replace(true_library(dofs), provenance={FRAMES: frames})
        save_model(path, Model(library, dofs))

    def counted(frame):
        for kind, topic in ((Odometry, "human/wrist"), (PoseStamped, TOOL.topic)):
            message = kind()
            message.header.frame_id, message.header.stamp = frame, to_stamp(10**18 + next(sent))
            harness.hear(node, topic, message)
        totals = node._diagnostics._totals
        return [totals[f"{entry.topic}, in another frame"] for entry in (WRIST, TOOL)]

    save({WRIST.topic: ["optitrack"], TOOL.topic: ["camera"]})
    node = harness.node(IntentEstimatorNode, model=str(path))
    assert counted("optitrack") == [0, 1] and counted("camera") == [1, 1]
    save({WRIST.topic: ["world"]})
    assert harness.trigger("intent_estimator/reload_model").success
    assert counted("world") == [1, 1] and counted("optitrack") == [2, 1]

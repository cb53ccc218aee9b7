# SPDX-License-Identifier: Apache-2.0
"""The estimator's start, and the frames that its poses come in."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from model_builder import GLOVE, TOOL, WRIST, make_dofs, true_library
from nav_msgs.msg import Odometry

from intent_recognition.demonstrations.dofs import DofEntry, DofSpec
from intent_recognition.model import FRAMES, Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose, to_stamp
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode, main
from intent_recognition.nodes.observation_input import human_topic

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


OTHER = DofEntry("joint_states", "sensor_msgs/msg/JointState", joints=("a", "b"), unit="rad")


@pytest.mark.parametrize(
    ("dofs", "said"),
    [
        (make_dofs(WRIST), ("mine.yaml: observed", "thumb", "/mocap/wrist/pose")),
        (DofSpec(DOFS.observed, (OTHER,)), ("mine.yaml: controlled", "lwr_a1_joint", '["a", "b"]')),
    ],
)
def test_a_dof_file_of_other_dofs_names_both_sides(capfd, model, tmp_path, dofs, said):
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(dofs.to_dict()))
    line = start(capfd, model=model, dofs=path)
    assert all(word in line for word in said)


def test_a_model_from_the_future_names_both_versions(capfd, model):
    with np.load(model, allow_pickle=False) as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    header["format_version"] = 17
    np.savez(model, **{**arrays, "header": np.array(json.dumps(header))})
    line = start(capfd, model=model)
    assert "format_version: expected 3, got 17" in line


def test_a_type_that_is_not_installed(capfd, tmp_path):
    alien = DofEntry("brain/waves", "alien_msgs/msg/Brain", fields=("alpha",), unit="V")
    dofs = make_dofs(alien)
    save_model(tmp_path / "m.npz", Model(true_library(dofs), dofs))
    assert "alien_msgs/msg/Brain" in start(capfd, model=tmp_path / "m.npz")


def test_it_listens_to_what_ingest_makes_of_a_raw_pose():
    assert human_topic(WRIST) == "human/wrist"
    cell = DofEntry("cell/mocap/elbow/pose", WRIST.type, fields=WRIST.fields, unit="m")
    assert human_topic(cell) == "cell/human/elbow"


TRACKED = make_dofs(WRIST, TOOL)
LEARNED = {WRIST.topic: ["optitrack"], TOOL.topic: ["camera"]}


def save(path, frames):
    library = replace(true_library(TRACKED), provenance={} if frames is None else {FRAMES: frames})
    save_model(path, Model(library, TRACKED))


class Stream:
    """The node, and what it gets, one message after the other."""

    def __init__(self, harness, tmp_path, frames):
        self.harness, self.path, self.n = harness, tmp_path / "m.npz", 0
        save(self.path, frames)
        self.node = harness.node(IntentEstimatorNode, model=str(self.path))
        self.inputs = [
            harness.publisher(Odometry, "human/wrist", qos.SENSOR),
            harness.publisher(PoseStamped, TOOL.topic, 10),
        ]
        harness.connect(*self.inputs)
        self.warnings = []
        self.node.people[""].inputs._node = self  # what the input logs

    def get_logger(self):
        return self

    def warning(self, text):
        self.warnings.append(text)

    def get_clock(self):
        return self.node.get_clock()

    def send(self, frame, group=0):
        self.n += 1
        message = (Odometry, PoseStamped)[group]()
        if group == 0:
            message.pose.pose = to_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        message.header.frame_id = frame
        message.header.stamp = to_stamp(1_700_000_000_000_000_000 + self.n * 10_000_000)
        self.harness.tell(self.node, self.inputs[group], message)

    def counted(self, entry):
        rows = values_of(self.node._diagnostics.report())
        return int(rows.get(f"received {entry.topic}, in another frame", 0))


def test_another_frame_is_told_once_and_counted(harness, tmp_path):
    stream = Stream(harness, tmp_path, LEARNED)
    for frame in ("optitrack", "/optitrack", "", "world", "world", "cell"):
        stream.send(frame)
    (text,) = stream.warnings
    assert text.startswith("mocap/wrist/pose: expected poses in the frame of the demonstrations")
    assert "'optitrack', got 'world'" in text
    assert "extrinsics" in text and "mocap_ingest" in text
    assert stream.counted(WRIST) == 3 and stream.counted(TOOL) == 0
    stream.send("camera", 1)
    assert len(stream.warnings) == 1
    stream.send("lens", 1)
    assert "'camera', got 'lens'" in stream.warnings[1] and stream.counted(TOOL) == 1


@pytest.mark.parametrize("frames", [None, {}, {TOOL.topic: ["camera"]}])
def test_a_model_that_knows_no_frame_is_silent(harness, tmp_path, frames):
    stream = Stream(harness, tmp_path, frames)
    for frame in ("world", "optitrack"):
        stream.send(frame)
    assert not stream.warnings and not stream.counted(WRIST)


def test_a_model_of_several_frames_fits_none(harness, tmp_path):
    stream = Stream(harness, tmp_path, {WRIST.topic: ["optitrack", "world"]})
    stream.send("world")
    assert "'optitrack' and 'world', got 'world'" in stream.warnings[0]


def test_a_model_that_is_loaded_again_brings_its_frame(harness, tmp_path):
    stream = Stream(harness, tmp_path, LEARNED)
    save(stream.path, {WRIST.topic: ["world"]})
    assert harness.trigger("intent_estimator/reload_model").success
    stream.send("world")
    assert not stream.warnings
    stream.send("optitrack")
    assert len(stream.warnings) == 1

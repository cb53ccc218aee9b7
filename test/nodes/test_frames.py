# SPDX-License-Identifier: Apache-2.0
"""The estimator says once when poses are in another frame than its model was learned in."""

from dataclasses import replace

import pytest
from geometry_msgs.msg import PoseStamped
from model_builder import TOOL, WRIST, make_dofs, true_library
from nav_msgs.msg import Odometry

from intent_recognition.model import FRAMES, Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose, to_stamp
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode

DOFS = make_dofs(WRIST, TOOL)
LEARNED = {WRIST.topic: ["optitrack"], TOOL.topic: ["camera"]}


def save(path, frames):
    library = replace(true_library(DOFS), provenance={} if frames is None else {FRAMES: frames})
    save_model(path, Model(library, DOFS))


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

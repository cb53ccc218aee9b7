# SPDX-License-Identifier: Apache-2.0
"""The files for RViz and PlotJuggler: topics that are offered, in the tasks' colours."""

from xml.etree import ElementTree as ET

import pytest
import yaml

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.report.drawing import PALETTE
from intent_recognition.share import share_path

OFFERED = {
    "robot_description": ("Reliable", "Transient Local"),
    "intent/markers": ("Reliable", "Volatile"),
    "intent/human_path": ("Reliable", "Volatile"),
    "mocap/wrist/pose": ("Best Effort", "Volatile"),
}


@pytest.fixture(scope="module")
def rviz():
    text = share_path("config/intent.rviz").read_text(encoding="utf-8")
    return yaml.safe_load(text)["Visualization Manager"]


def topics(display):
    """Name and settings of every topic of a display."""
    return [
        (value["Value"], value)
        for key, value in display.items()
        if key.endswith("Topic") and isinstance(value, dict)
    ]


def test_rviz_shows_arm_markers_and_path_in_the_world(rviz):
    assert rviz["Global Options"]["Fixed Frame"] == "world"
    kinds = {display["Class"].removeprefix("rviz_default_plugins/") for display in rviz["Displays"]}
    assert {"RobotModel", "MarkerArray", "Path", "Pose"} <= kinds


def test_rviz_listens_to_relative_topics_as_they_are_offered(rviz):
    found = dict(topic for display in rviz["Displays"] for topic in topics(display))
    assert set(found) == set(OFFERED)
    for topic, settings in found.items():
        assert (settings["Reliability Policy"], settings["Durability Policy"]) == OFFERED[topic]


@pytest.fixture(scope="module")
def curves():
    root = ET.parse(share_path("config/plotjuggler.xml")).getroot()
    return {curve.get("name"): curve.get("color") for curve in root.iter("curve")}


def test_plots_show_every_joint(curves):
    for part in ("position", "velocity", "effort"):
        for k, joint in enumerate(JOINT_NAMES):
            assert curves[f"/joint_states/{joint}/{part}"] == PALETTE[k]

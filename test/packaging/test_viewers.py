# SPDX-License-Identifier: Apache-2.0
"""The files for RViz and PlotJuggler: topics that are offered, in the tasks' colours."""

import re
from xml.etree import ElementTree as ET

import pytest
import yaml

from intent_recognition.kinematics.lwr import JOINT_NAMES
from intent_recognition.report.drawing import PALETTE, task_colours
from intent_recognition.share import share_path

OFFERED = {
    "robot_description": ("Reliable", "Transient Local"),
    "intent/markers": ("Reliable", "Volatile"),
    "intent/human_path": ("Reliable", "Volatile"),
    "mocap/wrist/pose": ("Best Effort", "Volatile"),
}
TASKS = ("hold_screwdriver", "plate_handover", "screw_handover")


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


def test_plots_have_the_colours_of_page_and_report(curves):
    colours = task_colours(TASKS)
    shown = re.compile(r"/intent/(?:tasks|next_task)/(\w+)/(?:position|velocity|effort)")
    tasks = {shown.fullmatch(name)[1] for name in curves if name.startswith("/intent/")}
    assert tasks == {*TASKS, "none"}
    for name, colour in curves.items():
        if name.startswith("/intent/"):
            assert colour == colours[shown.fullmatch(name)[1]]


def test_plots_show_every_joint(curves):
    for part in ("position", "velocity", "effort"):
        for k, joint in enumerate(JOINT_NAMES):
            assert curves[f"/joint_states/{joint}/{part}"] == PALETTE[k]


def test_sizes_of_the_layout_agree_with_what_is_in_it():
    root = ET.parse(share_path("config/plotjuggler.xml")).getroot()
    for splitter in root.iter("DockSplitter"):
        sizes = [float(size) for size in splitter.get("sizes").split(";")]
        assert len(sizes) == len(splitter) == int(splitter.get("count"))
        assert sum(sizes) == pytest.approx(1.0, abs=1e-3)

# SPDX-License-Identifier: Apache-2.0
"""The files for other people's tools name nodes and topics that are there."""

import ast
import json
import re
from xml.etree import ElementTree

import pytest
import yaml

from intent_recognition.registry import BODY, NODES
from intent_recognition.share import share_path

ABSOLUTE = {"/diagnostics", "/clock"}
TOPICS = ABSOLUTE | {
    "/" + topic.replace(BODY, "wrist")
    for node in NODES.values()
    for topic in (*node.publishes, *node.subscribes)
}


def text(name):
    return share_path(f"config/bring_up/{name}").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def analyzers():
    parameters = yaml.safe_load(text("diagnostics.yaml"))["analyzers"]["ros__parameters"]
    return [value for value in parameters.values() if isinstance(value, dict)]


def test_every_node_is_in_one_group_of_the_aggregator(analyzers):
    grouped = [name for analyzer in analyzers for name in analyzer["contains"]]
    assert sorted(grouped) == sorted(NODES)
    for analyzer in analyzers:
        assert analyzer["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert set(analyzer.get("expected", ())) <= set(analyzer["contains"])


def test_the_manager_takes_the_lifecycle_nodes_up_and_waits_for_no_bond():
    parameters = yaml.safe_load(text("lifecycle_manager.yaml"))["lifecycle_manager"]
    settings = parameters["ros__parameters"]
    assert set(settings["node_names"]) == {name for name, node in NODES.items() if node.managed}
    assert settings["bond_timeout"] == 0.0 and settings["autostart"] is False


def test_rqt_plots_topics_that_are_there():
    manager = json.loads(text("intent.perspective"))["groups"]["pluginmanager"]
    running = ast.literal_eval(manager["keys"]["running-plugins"]["repr"])
    assert "rqt_robot_monitor/RobotMonitor" in running
    plots = manager["groups"]
    assert set(plots) == {f"plugin__rqt_plot__Plot__{k}" for k in running["rqt_plot/Plot"]}
    for plot in plots.values():
        shown = ast.literal_eval(plot["groups"]["plugin"]["keys"]["topics"]["repr"])
        for curve in shown:
            assert re.fullmatch(r"(.+)/position\[\d\]", curve)[1] in TOPICS


def test_foxglove_shows_topics_that_are_there_in_panels_that_are_there():
    layout = json.loads(text("foxglove.json"))
    panels, placed = layout["configById"], []
    places = [layout["layout"]]
    while places:
        place = places.pop()
        if isinstance(place, str):
            placed.append(place)
        else:
            places += [place["first"], place["second"]]
    assert sorted(placed) == sorted(panels)
    named = {*panels["3D!cell"]["topics"], panels["DiagnosticSummary!nodes"]["topicToRender"]}
    named.add(panels["3D!cell"]["layers"]["urdf"]["topic"])
    for panel in panels.values():
        named |= {path["value"].partition(".")[0] for path in panel.get("paths", ())}
    assert named <= TOPICS
    assert {"/intent/tasks", "/intent/active_task", "/joint_states"} <= named


def test_plotjuggler_plots_topics_that_are_there():
    layout = share_path("config/plotjuggler.xml").read_text(encoding="utf-8")
    curves = [curve.get("name") for curve in ElementTree.fromstring(layout).iter("curve")]
    assert len(curves) > 20
    assert [c for c in curves if not any(c.startswith(f"{topic}/") for topic in TOPICS)] == []


OFFERED = {
    "robot_description": ("Reliable", "Transient Local"),
    "intent/markers": ("Reliable", "Volatile"),
    "intent/human_path": ("Reliable", "Volatile"),
    "mocap/wrist/pose": ("Best Effort", "Volatile"),
}


def test_rviz_listens_to_relative_topics_as_they_are_offered():
    shown = yaml.safe_load(share_path("config/intent.rviz").read_text(encoding="utf-8"))
    found = {
        value["Value"]: (value["Reliability Policy"], value["Durability Policy"])
        for display in shown["Visualization Manager"]["Displays"]
        for key, value in display.items()
        if key.endswith("Topic") and isinstance(value, dict)
    }
    assert found == OFFERED

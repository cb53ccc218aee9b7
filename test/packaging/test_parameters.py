# SPDX-License-Identifier: Apache-2.0
"""The shipped parameter file fits the nodes."""

import re

import pytest
import yaml
from every_node import needed, node_class

from intent_recognition.activation import ActivationSettings
from intent_recognition.kinematics import DEFAULT_ACCELERATION_RAD_S2
from intent_recognition.motion import SeparationSettings
from intent_recognition.motion.clearance import LARGEST_BEND, REPLAN_BUDGET_S, WAIT_S
from intent_recognition.nodes.graph import RECOGNITION
from intent_recognition.nodes.launch_checks import OF_EVERY_NODE
from intent_recognition.parameter_table import PARTS, parameters_of
from intent_recognition.recognition import FORGET_AFTER_S, MAX_WRONG
from intent_recognition.registry import NODES
from intent_recognition.share import share_path
from intent_recognition.tracking import IngestSettings
from intent_recognition.transfer import PATIENCE_S
from sim_bridge.arm import ANSWERING, NAMES
from sim_bridge.coworker import SessionTiming

TEXT = share_path("config/params.yaml").read_text(encoding="utf-8")
SECTIONS = yaml.safe_load(TEXT)


@pytest.mark.slow
@pytest.mark.parametrize("section", sorted(SECTIONS))
def test_node_takes_its_section(harness, section, tmp_path):
    name = section.removeprefix("/**/")
    values = SECTIONS[section]["ros__parameters"] | needed(name, tmp_path)
    if "autostart" in values:
        values["autostart"] = False
    node = harness.node(node_class(name), **values)
    assert node.get_name() == name
    for parameter, value in values.items():
        assert node.get_parameter(parameter).value == value, parameter
    if name in ("mocap_ingest", "primitive_activation"):
        for parameter in values:
            said = node.describe_parameter(parameter)
            if said.floating_point_range or said.integer_range:
                assert "larger value" in said.description, parameter
    own = set(node.get_parameters_by_prefix("")) - {*OF_EVERY_NODE}
    known = parameters_of(name)
    for parameter in own:
        said = node.describe_parameter(parameter)
        assert said.description and said.type and not said.dynamic_typing, parameter
        # one without a value of its type makes `ros2 param dump` print `{}` for the whole node
        assert said.type == node.get_parameter(parameter).get_parameter_value().type, parameter
        assert parameter not in known or said.read_only != known[parameter].live, parameter
    if name != "lwr_sim":
        assert own == set(known)
    assert own <= set(words(name)), "not in the shipped file, not even as a comment"


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*NODES} - {"dashboard"}))  # whose port is in use
def test_what_ros2_param_dump_writes_is_taken_again(harness, name, tmp_path):
    """Empty lists among it, which have no type in a file."""
    kind, model = node_class(name), {"autostart": False} if name == "intent_estimator" else {}

    def values(node):
        found = {k: p.value for k, p in node.get_parameters_by_prefix("").items() if "." not in k}
        return {k: v if isinstance(v, (str, bool, int, float)) else [*v] for k, v in found.items()}

    dumped = values(harness.node(kind, **needed(name, tmp_path), **model))
    path = tmp_path / "dump.yaml"
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": dumped}}), encoding="utf-8")
    again = harness.add(kind(cli_args=["--ros-args", "--params-file", str(path)]))
    assert values(again) == dumped


def words(name):
    """Every word of a section, comments included: parameters without a default stand there."""
    (section,) = re.findall(rf"^/\*\*/{name}:\n((?:  .*\n|\n)+)", TEXT, re.MULTILINE)
    return re.findall(r"\w+", section)


def test_every_node_has_a_section():
    assert {f"/**/{name}" for name in NODES} == set(SECTIONS)
    assert set(PARTS) == set(NODES)


def test_defaults_are_those_of_the_library():
    """The description is data, so that they stand in it too."""
    timing = SessionTiming()
    for node, expected in {
        "mocap_ingest": {"orientation_std_rad": IngestSettings.orientation_std_rad},
        "intent_estimator": {"forget_after": FORGET_AFTER_S},
        "primitive_activation": {
            "largest_bend": LARGEST_BEND,
            "replan_budget": REPLAN_BUDGET_S,
            "clear_wait": WAIT_S,
            "max_wrong": MAX_WRONG,
            "acceleration_limit": DEFAULT_ACCELERATION_RAD_S2,
            "timeout": ActivationSettings.timeout_s,
            "hold_time": ActivationSettings.hold_s,
            "switch_lead": ActivationSettings.lead_s,
            "max_joint_state_age": ActivationSettings.max_joint_state_age_s,
            "max_tracking_error": ActivationSettings.max_tracking_error_rad,
            "max_lateness": ActivationSettings.max_lateness_s,
            "human_speed": SeparationSettings.human_speed_m_s,
            "intrusion": SeparationSettings.intrusion_m,
            "least_speed": SeparationSettings.least_speed_m_s,
        },
        "object_transfer": {"patience": PATIENCE_S},
        "coworker_sim": {
            "wait_for_nodes": list(RECOGNITION),
            "first_idle": timing.first_idle_s,
            "idle": list(timing.idle_s),
            "hold": list(timing.hold_s),
            "last_idle": timing.last_idle_s,
            "occlusions": timing.gaps_per_s,
        },
    }.items():
        known = parameters_of(node)
        assert {name: known[name].default for name in expected} == expected


def test_what_can_be_chosen_is_named():
    of_arm = parameters_of("arm_sim")
    for name, choices in {"wait_for_answers": ANSWERING, "robot": NAMES}.items():
        assert ", ".join(choices) in of_arm[name].description
    for spec in (spec for node in NODES for spec in parameters_of(node).values() if spec.one_of):
        assert spec.default in spec.one_of and not spec.live

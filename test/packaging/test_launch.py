# SPDX-License-Identifier: Apache-2.0
"""What the launch files start, and refuse, against stand-ins of `launch`."""

import shlex
import subprocess
import sys
import types

import pytest
import yaml
from ament_index_python.packages import PackageNotFoundError
from stand_in_launch import Call, Context, declared, on, start, values

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.kinematics import parse_xml
from intent_recognition.nodes import launch_checks
from intent_recognition.nodes.processes import PROFILES, RANGE
from intent_recognition.promp import USUAL_END_STD
from intent_recognition.registry import NODES as REGISTERED
from intent_recognition.share import share_path
from sim_bridge.arm import find_robot
from sim_bridge.handover import with_fingers

RECOGNITION = {"mocap_ingest", "intent_estimator", "primitive_activation"}
WARPERS = {"cup_warper", "second_warper"}
EXECUTABLES = {
    "intent": RECOGNITION,
    "sim": {"lwr_sim", "coworker_sim"},
    "demo": RECOGNITION | {"lwr_sim", "object_transfer", "coworker_sim"},
    "assembly": RECOGNITION | {"arm_sim", "coworker_sim"},
    "pouring": WARPERS | {"lwr_sim", "warped_primitive", "primitive_activation"},
    "real": RECOGNITION,
    "replay": {"bag_player", "mocap_ingest", "intent_estimator"},
}
OTHERS = {"rviz2", "robot_state_publisher"}
NODE_OPTIONS = {
    *("package", "executable", "name", "namespace", "exec_name", "parameters", "remappings"),
    *("ros_arguments", "arguments", "output", "respawn", "respawn_delay", "on_exit", "prefix"),
}


@pytest.mark.parametrize("name", EXECUTABLES)
def test_nodes_are_executables_with_parameters(describe, repository, name):
    entities = describe(name)
    assert set(start(entities)) == EXECUTABLES[name]
    sections = yaml.safe_load((repository / "config" / "params.yaml").read_text(encoding="utf-8"))
    for node, options in start(entities, **on(entities)).items():
        executable = options["executable"]
        assert executable == node or node in WARPERS
        if node in OTHERS:
            assert options["package"] == node
        else:
            assert options["package"] == "intent_recognition"
            assert executable in REGISTERED
            assert f"/**/{executable}" in sections
        if node in WARPERS:  # the file names the executable
            assert options["parameters"][0]["source"] == "mug"


def test_interrupts_wait_until_a_node_can_end_at_them(describe):
    entities = describe("demo")
    nodes = start(entities, **on(entities))
    code = (
        "import os, signal; os.kill(os.getpid(), signal.SIGINT)\n"
        "from intent_recognition.nodes.start import start; start('mocap_ingest')"
    )
    command = [*shlex.split(nodes["mocap_ingest"]["prefix"]), sys.executable, "-c", code]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")
    assert all(nodes[name]["prefix"] is None for name in OTHERS)
    (action,) = [e for e in entities if e.kind == "OpaqueFunction"]
    given = {
        name: options.get("default_value", __file__) for name, options in declared(entities).items()
    }
    context = Context({**given, "launch-prefix": "gdb --args"})
    calls = action.options["function"](context, *action.options["args"])
    assert {call.options["prefix"] for call in calls} == {None}


@pytest.mark.parametrize("name", ["env", "other"])
def test_nodes_start_where_env_cannot_block_interrupts(describe, monkeypatch, tmp_path, name):
    (tmp_path / name).write_text("#!/bin/sh\nexit 125\n")
    (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert {node["prefix"] for node in start(describe("demo")).values()} == {None}


@pytest.mark.parametrize("section", ["object_warper", "/cell1/object_warper", "/**/object_warper"])
def test_both_warpers_take_the_section_of_their_executable(describe, tmp_path, section):
    own = tmp_path / "mine.yaml"
    own.write_text(f"/**:\n{section}:\n  ros__parameters: {{source: bowl}}\n")
    namespace = "" if section == "object_warper" else "cell1"
    nodes = start(describe("pouring"), params_file=str(own), namespace=namespace)
    for node in WARPERS:
        assert nodes[node]["parameters"][0]["source"] == "bowl"


@pytest.mark.parametrize("name", EXECUTABLES)
def test_every_node_takes_the_namespace_and_the_clock_and_starts_again_unless_it_ends(
    describe, name
):
    entities = describe(name)
    nodes = start(entities, namespace="/cell1/", use_sim_time="true", **on(entities))
    publishers = 0
    for node, options in nodes.items():
        ends = node in ("bag_player", "bag_recorder", "rviz2")
        assert options["respawn"] is not ends and options["respawn_delay"] > 0.0, node
        assert options["namespace"] == "/cell1"
        publishes = values(options).get("publish_clock") or values(options).get("clock")
        publishers += bool(publishes)
        assert bool(publishes) != (values(options).get("use_sim_time") is True), node
    assert publishers == (name in ("demo", "assembly", "pouring", "replay"))
    never = start(entities, respawn="false", **on(entities))
    assert not any(options["respawn"] for options in never.values())


@pytest.mark.parametrize("name", EXECUTABLES)
def test_nodes_are_given_what_launch_ros_takes(describe, name):
    """As its source on the branch jazzy says: no other options, no empty or mixed lists."""
    entities = describe(name)
    given = on(entities) | ({"bodies": " , "} if "bodies" in declared(entities) else {})
    for node in start(entities, **given).values():
        assert set(node) <= NODE_OPTIONS
        *_, file, parameters = node["parameters"]
        assert isinstance(file, str)
        for value in parameters.values():
            if isinstance(value, list):
                assert value and len({type(entry) for entry in value}) == 1
            elif isinstance(value, Call):  # a text is to stay one
                assert value.kind == "ParameterValue" and type(value.args[0]) is str
            else:
                assert type(value) in (bool, int, float)
        for pair in node["remappings"]:
            assert [type(topic) for topic in pair] == [str, str]


def test_what_is_not_given_is_left_to_the_parameter_file(describe):
    nodes = start(describe("intent"), model=__file__)
    assert values(nodes["intent_estimator"]) == {"model": __file__}
    assert nodes["intent_estimator"]["parameters"][1]["model"].options == {"value_type": str}
    assert nodes["mocap_ingest"]["parameters"][0].endswith("config/params.yaml")
    assert "use_sim_time" not in values(nodes["primitive_activation"])


def test_a_real_arm_is_slow_and_waits(describe, repository):
    nodes = start(
        describe("real"), bodies="left_hand, right_hand", joint_states_topic="/arm/states"
    )
    activation = nodes["primitive_activation"]
    assert values(activation)["autostart"] is False
    assert activation["remappings"] == [
        ("joint_states", "/arm/states"),
        ("joint_trajectory", "joint_trajectory_controller/joint_trajectory"),
    ]
    assert ("joint_states", "/arm/states") in nodes["intent_estimator"]["remappings"]
    assert values(nodes["mocap_ingest"])["bodies"] == ["left_hand", "right_hand"]
    assert "use_sim_time" not in values(activation)
    shipped, safe = (
        yaml.safe_load((repository / "config" / name).read_text(encoding="utf-8"))
        for name in ("params.yaml", "real_arm.yaml")
    )
    shipped = shipped["/**/primitive_activation"]["ros__parameters"]
    safe = safe["/**"]["ros__parameters"]
    assert activation["parameters"][0].endswith("config/real_arm.yaml")
    slower = ("velocity_scale", "acceleration_limit", "timeout", "max_wrong")
    assert 0.0 < safe["max_end_std"] < USUAL_END_STD["rad"]
    assert all(safe[key] < shipped[key] for key in slower)
    assert safe["n_observations"] > shipped["n_observations"]


def test_a_replay_moves_no_arm_and_plays_no_answer(describe):
    nodes = start(describe("replay"), rate="0", loop="true")
    assert "primitive_activation" not in nodes
    player = values(nodes["bag_player"])
    assert player["rate"] == 0.0
    assert player["loop"] is True
    assert {"intent/", "human/", "joint_trajectory"} <= set(player["without"])


@pytest.mark.parametrize("name", ["demo", "sim"])
def test_another_arm_takes_the_place_of_the_lwr(describe, name):
    nodes = start(describe(name), arm="panda", rviz="true")
    assert "lwr_sim" not in nodes
    assert values(nodes["arm_sim"])["robot"] == "panda"
    assert "panda_joint1" in values(nodes["robot_state_publisher"])["robot_description"]


@pytest.mark.parametrize("name", ["demo", "real"])
def test_nodes_use_our_profiles_of_fast_dds_unless_the_user_has_some(describe, monkeypatch, name):
    for variable in PROFILES:
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv(RANGE, "SUBNET")
    added = [e.args for e in describe(name) if e.kind == "SetEnvironmentVariable"]
    assert {variable for variable, _ in added} == set(PROFILES)
    monkeypatch.setenv(PROFILES[0], "mine.xml")
    assert not [e for e in describe(name) if e.kind == "SetEnvironmentVariable"]


@pytest.mark.parametrize("name", EXECUTABLES)
def test_the_arms_topics_reach_every_node_that_uses_them(describe, name):
    entities = describe(name)
    topics = {"joint_states_topic": "/arm/states", "command_topic": "/arm/go"}
    given = {
        argument: topic for argument, topic in topics.items() if argument in declared(entities)
    }
    nodes = start(entities, **given, **on(entities))
    for node, options in nodes.items():
        remapped = dict(options["remappings"])
        uses_states = node not in ("mocap_ingest", "coworker_sim", "rviz2", *WARPERS)
        assert remapped.get("joint_states") == ("/arm/states" if uses_states else None), node
        commands = node in ("lwr_sim", "primitive_activation", "bag_recorder", "dashboard")
        assert (remapped.get("joint_trajectory") == "/arm/go") >= commands, node


def test_what_begins_something_waits_for_its_graph(describe):
    recognition = ["mocap_ingest", "intent_estimator"]
    player = start(describe("replay"))["bag_player"]
    assert values(player)["wait_for_nodes"] == recognition
    chain = ["lwr_sim", *recognition, "primitive_activation"]
    feels = "object_transfer"
    for given, more in (
        ({}, [feels]),
        ({"record": "bag"}, [feels, "bag_recorder"]),
        ({"transfers": "false"}, []),
    ):
        coworker = start(describe("demo"), **given)["coworker_sim"]
        assert values(coworker)["wait_for_nodes"] == [*chain, *more]
    assert values(start(describe("sim"))["coworker_sim"])["wait_for_nodes"] == chain


def test_an_arm_stands_where_the_second_person_does(describe):
    nodes = {name: values(node) for name, node in start(describe("assembly"), arm="iiwa").items()}
    assert nodes["coworker_sim"]["scenario"] == "assembly"
    tip = {nodes[node]["hand_link"] for node in ("intent_estimator", "primitive_activation")}
    assert tip == {"lbr_iiwa_link_7"}
    assert nodes["arm_sim"]["initial_position"] == nodes["primitive_activation"]["home"]
    given = start(describe("assembly"), arm="iiwa", hand_link="lbr_iiwa_link_6")
    assert values(given["intent_estimator"])["hand_link"] == "lbr_iiwa_link_6"


@pytest.mark.parametrize(("arm", "node"), [("", "lwr_sim"), ("panda", "arm_sim")])
def test_the_demo_hands_over_by_force(describe, arm, node):
    nodes = {name: values(one) for name, one in start(describe("demo"), arm=arm).items()}
    assert nodes[node]["scene"] == "transfers"
    felt = nodes["object_transfer"]
    robot = with_fingers(find_robot(arm or "lwr"))
    links = {link.get("name") for link in parse_xml(robot.description).findall("link")}
    joints = {joint.get("name") for joint in parse_xml(robot.description).findall("joint")}
    assert felt["hand_link"] in links and len(joints.intersection(felt["fingers"])) == 2
    empty = start(describe("demo"), arm=arm, transfers="false")
    assert "object_transfer" not in empty and "scene" not in values(empty[node])


def test_a_file_of_ones_own_is_taken(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    own.write_text("{}", encoding="utf-8")
    for name, shipped in (("real", "config/real_arm.yaml"), ("intent", "config/params.yaml")):
        for node in start(describe(name), params_file=str(own)).values():
            first, second, _ = node["parameters"]
            assert first.endswith(shipped) and second == str(own)


def test_a_published_clock_is_followed_or_refused(describe):
    nodes = start(describe("sim"), publish_clock="true")
    assert values(nodes["coworker_sim"])["use_sim_time"] is True
    assert "use_sim_time" not in values(nodes["lwr_sim"])
    assert "use_sim_time" not in values(start(describe("sim"))["coworker_sim"])
    with pytest.raises(ArgumentError, match="use_sim_time"):
        start(describe("sim"), publish_clock="true", use_sim_time="false")
    with pytest.raises(ArgumentError, match="use_sim_time"):
        start(describe("replay"), use_sim_time="false")


@pytest.mark.parametrize(("code", "ends"), [(0, False), (1, True), (-9, False), (-11, False)])
def test_a_node_that_cannot_start_ends_the_launch_and_one_that_dies_does_not(describe, code, ends):
    node = start(describe("real"))["primitive_activation"]
    exited = types.SimpleNamespace(returncode=code, process_name="primitive_activation-3")
    if not ends:
        assert node["on_exit"](exited, Context()) is None
        return
    with pytest.raises(IntentError, match="primitive_activation-3 cannot run"):
        node["on_exit"](exited, Context())


def test_what_is_optional_is_there_before_the_first_node_starts(describe, monkeypatch, tmp_path):
    entities = describe("replay")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ArgumentError, match="bag: expected a file or folder"):
        start(entities, bag="missing")
    with pytest.raises(ArgumentError, match="model: expected a file or folder"):
        start(entities, model="missing.npz")
    with pytest.raises(ArgumentError, match="skill: expected a file or folder"):
        start(describe("pouring"), skill="missing")
    monkeypatch.setattr(launch_checks, "find_spec", lambda _: None)
    with pytest.raises(ArgumentError, match="Install ros-jazzy-control-msgs"):
        start(describe("real"), command_action="arm/follow_joint_trajectory")
    monkeypatch.setattr(launch_checks, "get_package_prefix", no_package)
    with pytest.raises(ArgumentError, match="rviz: expected the package robot_state_publisher"):
        start(entities, rviz="true")


def test_ros2_control_looks_first_and_starts_its_own_nodes_last(describe, monkeypatch):
    _, check, graph, controllers = describe("ros2_control")
    assert graph.kind == "IncludeLaunchDescription"
    check, controllers = check.options["function"], controllers.options["function"]
    context = Context(arm="lwr", namespace="/cell1/")
    assert check(context) == []
    for node in controllers(context):
        assert node.options["namespace"] == "cell1"
        with pytest.raises(IntentError, match="spawner-2 cannot run"):
            exited = types.SimpleNamespace(returncode=1, process_name="spawner-2")
            node.options["on_exit"](exited, context)
    command = ["ros2", "launch", "intent_recognition", "ros2_control.launch.py", "modle:=m.npz"]
    for wrong, said in (
        (command, "mean model"),
        ([*command[:-1], "command_action:=a"], "got command_action"),
    ):
        monkeypatch.setattr(sys, "argv", wrong)
        with pytest.raises(ArgumentError, match=said):
            check(context)
    monkeypatch.setattr(sys, "argv", [*command[:-1], "activate:=true", "arm:=lwr"])
    check(context)
    monkeypatch.setattr(launch_checks, "get_package_prefix", no_package)
    with pytest.raises(ArgumentError, match="Install ros-jazzy-controller-manager"):
        check(context)


def no_package(name):
    raise PackageNotFoundError(name)


def test_an_argument_that_nobody_takes_is_refused(describe, monkeypatch):
    entities = describe("demo")
    ours = ["intent_recognition", "demo.launch.py"], [str(share_path("launch/demo.launch.py"))]
    for words in ours:
        monkeypatch.setattr(sys, "argv", ["ros2", "launch", *words, "modle:=m.npz"])
        with pytest.raises(ArgumentError, match="Did you mean model"):
            start(entities)
        monkeypatch.setattr(sys, "argv", ["ros2", "launch", *words, "launch-prefix:=gdb --args"])
        assert start(entities)
    for words in (["mine.launch.py"], ["my_cell", "demo.launch.py"]):  # they include ours
        monkeypatch.setattr(sys, "argv", ["ros2", "launch", *words, "other:=1"])
        assert start(entities)


@pytest.mark.parametrize(
    ("section", "name", "said"),
    [
        ("/**/mocap_ingst", "use_sim_time", "mocap_ingst"),
        ("/cell1/nobody", "use_sim_time", "nobody"),
        *((name, "use_sim_time", "") for name in ("/**", "/cell1/*", "object_warper")),
        ("/cell2/mocap_ingest", "use_sim_time", ""),
        ("/**/mocap_ingest", "max_sped", "max_sped. Did you mean"),
        ("cup_warper", "neighbors", "neighbors. Did you mean"),
        ("primitive_activation", "threshold", ""),
        ("primitive_activation", "qos_overrides", ""),
        ("somebody/**", "anything", ""),
        ("/**", "anything", ""),
    ],
)
def test_a_section_that_no_node_takes_or_a_parameter_that_it_has_not_is_refused(
    describe, tmp_path, section, name, said
):
    (own := tmp_path / "mine.yaml").write_text(f"{section}:\n  ros__parameters: {{{name}: 1.0}}\n")
    namespace = "somebody" if name == "anything" else "cell1"
    given = {"params_file": str(own), "namespace": namespace}
    if not said:
        assert start(describe("intent"), **given)
        return
    with pytest.raises(ArgumentError, match=said):
        start(describe("intent"), **given)


def test_a_section_that_is_written_twice_is_refused_with_the_file(describe, tmp_path):
    section = "/**/mocap_ingest:\n  ros__parameters: {use_sim_time: true}\n"
    (own := tmp_path / "mine.yaml").write_text(2 * section)
    with pytest.raises(ArgumentError, match=r"mine\.yaml: .*/\*\*/mocap_ingest twice"):
        start(describe("intent"), params_file=str(own))


def test_a_namespace_around_the_launch_file_counts(describe, tmp_path):
    (own := tmp_path / "mine.yaml").write_text("/cell1/arm/*:\n  ros__parameters: {a: 1}\n")
    given = {"ros_namespace": "/cell1", "namespace": "arm", "params_file": str(own)}
    node = start(describe("intent"), **given)["mocap_ingest"]
    assert node["namespace"] == "/cell1/arm"
    assert node["ros_arguments"] == ["--enclave", "/cell1/arm/mocap_ingest"]


KINDS = [
    ("rate", "fast", "expected a number, got 'fast'. Give rate:=1.0."),
    ("headless", "perhaps", "expected true or false, got 'perhaps'. Give headless:=true."),
    ("seed", "1.5", "expected a whole number, got '1.5'. Give seed:=1."),
]


@pytest.mark.parametrize(("name", "value", "message"), KINDS)
def test_a_value_of_another_kind_is_named(describe, name, value, message):
    with pytest.raises(ArgumentError, match=f"{name}: {message}"):
        start(describe("demo"), **{name: value})

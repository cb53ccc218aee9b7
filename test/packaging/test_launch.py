# SPDX-License-Identifier: Apache-2.0
"""The launch files against stand-ins of `launch` and `launch_ros`, which no package index has."""

import runpy
import sys
import types
from dataclasses import dataclass, field

import pytest
import yaml
from ament_index_python.packages import PackageNotFoundError

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes import launch_checks
from intent_recognition.nodes.processes import PROFILES, RANGE
from intent_recognition.promp import USUAL_END_STD
from intent_recognition.registry import NODES as REGISTERED

RECOGNITION = {"mocap_ingest", "intent_estimator", "primitive_activation"}
WARPERS = {"cup_warper", "second_warper"}
EXECUTABLES = {
    "intent": RECOGNITION,
    "sim": {"lwr_sim", "coworker_sim"},
    "demo": RECOGNITION | {"lwr_sim", "coworker_sim"},
    "assembly": RECOGNITION | {"arm_sim", "coworker_sim"},
    "pouring": WARPERS | {"lwr_sim", "warped_primitive", "primitive_activation"},
    "real": RECOGNITION,
    "replay": {"bag_player", "mocap_ingest", "intent_estimator"},
}
OTHERS = {"rviz2", "robot_state_publisher"}
NODE_OPTIONS = {
    *("package", "executable", "name", "namespace", "exec_name", "parameters", "remappings"),
    *("ros_arguments", "arguments", "output", "respawn", "respawn_delay", "on_exit"),
}
NEEDED = {"model": __file__, "bag": __file__}
"""Any files: they are only looked for."""
ALL_ON = {"dashboard": "true", "rviz": "true", "record": "a/bag"}


@dataclass
class Call:
    """What a launch action was made with."""

    kind: str
    args: tuple
    options: dict = field(default_factory=dict)


class Context(dict):
    """The values of launch arguments."""


class Configuration(Call):
    def perform(self, context):
        return context[self.args[0]]


def recorder(kind):
    make = Configuration if kind == "LaunchConfiguration" else Call
    return lambda *args, **options: make(kind, args, options)


MODULES = {
    "launch": ["LaunchContext", "LaunchDescription"],
    "launch.actions": [
        *("DeclareLaunchArgument", "IncludeLaunchDescription", "OpaqueFunction"),
        "SetEnvironmentVariable",
    ],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["LaunchConfiguration"],
    "launch_ros": [],
    "launch_ros.actions": ["Node"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
}


@pytest.fixture
def describe(repository, monkeypatch):
    """Function from the name of a launch file to its entities."""
    monkeypatch.setattr(launch_checks, "get_package_prefix", lambda name: name)
    for name, members in MODULES.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, recorder(member))
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, "intent_recognition.nodes.launching", raising=False)

    def run(name):
        namespace = runpy.run_path(str(repository / "launch" / f"{name}.launch.py"))
        return namespace["generate_launch_description"]().args[0]

    yield run
    sys.modules.pop("intent_recognition.nodes.launching", None)


def declared(entities):
    return {e.args[0]: e.options for e in entities if e.kind == "DeclareLaunchArgument"}


def start(entities, **given):
    """The nodes, by name, as launch would start them with these arguments."""
    context = Context()
    for name, options in declared(entities).items():
        context[name] = options["default_value"] if "default_value" in options else NEEDED[name]
    (action,) = [e for e in entities if e.kind == "OpaqueFunction"]
    unknown = set(given) - set(context)
    assert not unknown, unknown
    context.update(given)
    nodes = action.options["function"](context, *action.options["args"])
    return {node.options["name"]: node.options for node in nodes}


def on(entities):
    """The arguments that start everything there is."""
    return {name: value for name, value in ALL_ON.items() if name in declared(entities)}


def values(node):
    """What a node's parameters are set to, the file aside."""
    *_, given = node["parameters"]
    return {k: v.args[0] if isinstance(v, Call) else v for k, v in given.items()}


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


@pytest.mark.parametrize("name", EXECUTABLES)
def test_every_node_takes_the_namespace_and_the_clock(describe, name):
    entities = describe(name)
    nodes = start(entities, namespace="/cell1/", use_sim_time="true", **on(entities))
    publishers = 0
    for node, options in nodes.items():
        assert options["namespace"] == "cell1"
        publishes = values(options).get("publish_clock") or values(options).get("clock")
        publishers += bool(publishes)
        assert bool(publishes) != (values(options).get("use_sim_time") is True), node
    assert publishers == (name in ("demo", "assembly", "pouring", "replay"))


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


def test_nodes_that_die_start_again_but_those_that_end(describe):
    for name in EXECUTABLES:
        entities = describe(name)
        for node, options in start(entities, **on(entities)).items():
            ends = node in ("bag_player", "bag_recorder", "rviz2")
            assert options["respawn"] is not ends, node
            assert options["respawn_delay"] > 0.0
        nodes = start(entities, respawn="false", **on(entities))
        assert not any(options["respawn"] for options in nodes.values())


def test_what_begins_something_waits_for_its_graph(describe):
    recognition = ["mocap_ingest", "intent_estimator"]
    player = start(describe("replay"))["bag_player"]
    assert values(player)["wait_for_nodes"] == recognition
    chain = ["lwr_sim", *recognition, "primitive_activation"]
    for given, more in (({}, []), ({"record": "bag"}, ["bag_recorder"])):
        coworker = start(describe("demo"), **given)["coworker_sim"]
        assert values(coworker)["wait_for_nodes"] == [*chain, *more]
    assert values(start(describe("sim"))["coworker_sim"])["wait_for_nodes"] == chain


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
    monkeypatch.setattr(launch_checks, "get_package_prefix", no_package)
    with pytest.raises(ArgumentError, match="rviz: expected the package robot_state_publisher"):
        start(entities, rviz="true")


def test_ros2_control_looks_first_and_starts_its_own_nodes_last(describe, monkeypatch):
    _, check, graph, controllers = describe("ros2_control")
    assert graph.kind == "IncludeLaunchDescription"
    check, controllers = check.options["function"], controllers.options["function"]
    context = Context(arm="lwr")
    assert check(context) == []
    for node in controllers(context):
        with pytest.raises(IntentError, match="spawner-2 cannot run"):
            exited = types.SimpleNamespace(returncode=1, process_name="spawner-2")
            node.options["on_exit"](exited, context)
    command = ["ros2", "launch", "intent_recognition", "ros2_control.launch.py", "modle:=m.npz"]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(ArgumentError, match="Did you mean model"):
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
    command = ["ros2", "launch", "intent_recognition", "demo.launch.py", "modle:=m.npz"]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(ArgumentError, match="Did you mean model"):
        start(entities)
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "mine.launch.py", "other:=1"])
    assert start(entities)


def test_a_section_that_no_node_takes_is_refused(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    for section, taken in (
        ("/**/mocap_ingst", False),
        ("/cell1/nobody", False),
        ("/**", True),
        ("/cell1/*", True),
        ("object_warper", True),
        ("/cell2/mocap_ingest", True),
    ):
        own.write_text(f"{section}:\n  ros__parameters: {{use_sim_time: true}}\n", encoding="utf-8")
        if taken:
            assert start(describe("intent"), params_file=str(own), namespace="cell1")
            continue
        with pytest.raises(ArgumentError, match=section.rsplit("/", 1)[-1]):
            start(describe("intent"), params_file=str(own), namespace="cell1")


def test_a_parameter_that_the_node_has_not_is_refused(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    for section, name, taken in (
        ("/**/mocap_ingest", "max_sped", False),
        ("cup_warper", "neighbors", False),
        ("primitive_activation", "threshold", True),
        ("primitive_activation", "qos_overrides", True),
        ("somebody/**", "anything", True),
        ("/**", "anything", True),
    ):
        own.write_text(f"{section}:\n  ros__parameters: {{{name}: 1.0}}\n", encoding="utf-8")
        if taken:
            assert start(describe("intent"), params_file=str(own), namespace="somebody")
            continue
        with pytest.raises(ArgumentError, match=f"{name}. Did you mean"):
            start(describe("intent"), params_file=str(own))


def test_an_arm_stands_where_the_second_person_does(describe):
    nodes = {name: values(node) for name, node in start(describe("assembly"), arm="iiwa").items()}
    assert nodes["coworker_sim"]["scenario"] == "assembly"
    tip = {nodes[node]["hand_link"] for node in ("intent_estimator", "primitive_activation")}
    assert tip == {"lbr_iiwa_link_7"}
    assert nodes["arm_sim"]["initial_position"] == nodes["primitive_activation"]["home"]
    given = start(describe("assembly"), arm="iiwa", hand_link="lbr_iiwa_link_6")
    assert values(given["intent_estimator"])["hand_link"] == "lbr_iiwa_link_6"


def test_a_file_of_ones_own_is_taken(describe, tmp_path):
    own = tmp_path / "mine.yaml"
    own.write_text("{}", encoding="utf-8")
    for name, shipped in (("real", "config/real_arm.yaml"), ("intent", "config/params.yaml")):
        for node in start(describe(name), params_file=str(own)).values():
            first, second, _ = node["parameters"]
            assert first.endswith(shipped) and second == str(own)


@pytest.mark.parametrize("given", [{"rate": "fast"}, {"headless": "perhaps"}, {"seed": "1.5"}])
def test_a_value_of_another_kind_is_named(describe, given):
    with pytest.raises(ArgumentError, match=next(iter(given))):
        start(describe("demo"), **given)

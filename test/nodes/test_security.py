# SPDX-License-Identifier: Apache-2.0
"""Names and qualities of service that the contract fixes, and policies of SROS 2: each node may do
what it does, under its names, and no more.
"""

from functools import partial
from xml.etree import ElementTree

import pytest
import yaml
from bag_builder import write_bag
from every_node import needed, node_class
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSReliabilityPolicy

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.graph import GRAPHS, NODES, OWN_TOPICS, RECORDED
from intent_recognition.nodes.qos import LATCHED_TOPICS
from intent_recognition.nodes.security import main, policy
from intent_recognition.registry import NODES as REGISTERED
from intent_recognition.share import PACKAGE

TOLD = {"joint_states_topic": "/arm/states", "command_topic": "/arm/command"}
ALL_ON = {"record": "bag", "dashboard": True, "coworker": True, "transfers": True}
ALL_ON |= {"namespace": "cell1"}
OF_POURING = {"balls", "cup/cloud", "intent/feedback", "second/cloud"}
OF_ITS_CLOCK = {"clock_answers"}
OF_TRANSFERS = {"intent/transfer", "mocap/wrist/pose", "coworker/hand", "intent/holding"}
OF_TRANSFERS |= {"intent/active_person", "intent/active_task"}
LATER = {
    **dict.fromkeys(("arm_sim", "lwr_sim"), OF_POURING | OF_ITS_CLOCK | OF_TRANSFERS),
    "object_transfer": {"intent/active_person"},  # with several people
    "intent_estimator": {"human/wrist", "joint_states"},  # once it has a model
    "primitive_activation": {"intent/next_task", "intent/robot_trajectory", "intent/tasks"}
    | {"joint_states", "joint_trajectory"}
    | {"human/wrist", "intent/sequence", "intent/via_points"}
    | {"intent/active_person"}  # with several people
    | {"monitored_planning_scene", "planning_scene"},  # with MoveIt
    "bag_recorder": {*RECORDED},
    "bag_player": {topic for topic in RECORDED if not topic.startswith(OWN_TOPICS)},
    "task_teacher": {"mocap/wrist/pose", "joint_states", "robot_description"},
    "dashboard": {"mocap/wrist/pose", "joint_trajectory", "robot_description", "joint_states"},
    "coworker_sim": set(),
}
"""Topics that a node takes up after its start, or with a file of sequences."""
GIVEN = {
    "intent_estimator": {"autostart": False},
    "primitive_activation": {"person_dofs": ["x", "y", "z"]},
    "bag_player": {"wait_for_subscribers": 0.0},
    "lwr_sim": {"publish_clock": True, "controller": "stochastic_feedback"},
    "coworker_sim": {"use_sim_time": True},
}
"""Parameters that make a node use more topics than it does by default, or wait until asked."""
SENSOR = (QoSReliabilityPolicy.BEST_EFFORT, QoSDurabilityPolicy.VOLATILE, 10)
STATE = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 10)
COMMAND = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.VOLATILE, 1)
LATCHED = (QoSReliabilityPolicy.RELIABLE, QoSDurabilityPolicy.TRANSIENT_LOCAL, 1)
OFFERED = {
    "mocap_ingest": {"human/wrist": SENSOR},
    "intent_estimator": {
        "intent/tasks": STATE, "intent/robot_trajectory": COMMAND, "intent/human_path": COMMAND,
        "intent/human_trajectory": COMMAND, "intent/markers": COMMAND,
        "intent/next_task": LATCHED,
    },
    "primitive_activation": {"joint_trajectory": COMMAND, "intent/active_task": LATCHED},
    "object_warper": {"object/labelled_cloud": STATE, "object/parameters": STATE},
    "object_transfer": {"intent/transfer": STATE},
    "lwr_sim": {"joint_states": STATE, "robot_description": LATCHED},
    "coworker_sim": {"mocap/wrist/pose": SENSOR, "coworker/task": STATE},
    "task_teacher": {"teach/status": LATCHED},
}  # fmt: skip
SERVICES = {
    "intent_estimator": {"reset", "reload_model"},
    "primitive_activation": {"reset"},
    "bag_recorder": {"start", "stop"},
    "bag_player": {"pause", "resume"},
    "task_teacher": {"start", "stop", "learn", "discard", "undo"},
    "lwr_sim": {"gravity_compensation"},
}


@pytest.fixture
def bag(tmp_path):
    write_bag(tmp_path / "bag")
    return str(tmp_path / "bag")


def allowed(text: str) -> dict[str, dict[str, set[str]]]:
    """Full names by node and by what it may do with them."""
    found: dict[str, dict[str, set[str]]] = {}
    for profile in ElementTree.fromstring(text).iter("profile"):
        ns, node = profile.get("ns").rstrip("/"), profile.get("node")
        rules = found.setdefault(node, {})
        for group in profile:
            ((rule, qualifier),) = group.attrib.items()
            assert qualifier == "ALLOW"
            for item in group:
                name = item.text.replace("~", node, 1)
                rules.setdefault(rule, set()).add(name if name[0] == "/" else f"{ns}/{name}")
    return found


def given(graph: str, bag: str, **more: object) -> dict:
    """Every part of a graph on."""
    known = {argument.name for argument in GRAPHS[graph].arguments()}
    every = {"dofs": "", "model": "", "bag": bag} | ALL_ON | more
    return {name: value for name, value in every.items() if name in known and value != ""}


FRAMES = {"/tf", "/tf_static"}
ABSOLUTE = {"/clock", "/diagnostics", "/rosout", "/parameter_events", *FRAMES}
IN_NO_GRAPH = {"arm_sim", "object_warper", "warped_primitive"}
"""Under these names, or not in these graphs as they are given."""


def make(harness, name, folder):
    values = needed(name, folder) | GIVEN.get(name, {})
    return harness.node(partial(node_class(name), namespace="/cell1"), **values)


def check_contract(node, name):
    """Names are in the namespace, and topics and services offered as the contract says."""
    topics = {entity.topic_name for entity in (*node.publishers, *node.subscriptions)}
    assert "/diagnostics" in topics
    assert all(topic.startswith("/cell1/") for topic in topics - ABSOLUTE)
    offered = {service.service_name for service in node.services}
    assert all(service.startswith(f"/cell1/{name}/") for service in offered)
    assert offered >= {f"/cell1/{name}/{service}" for service in SERVICES.get(name, ())}
    profiles = {p.topic_name: p.qos_profile for p in node.publishers}
    for topic, (reliability, durability, depth) in OFFERED.get(name, {}).items():
        profile = profiles[f"/cell1/{topic}"]
        assert (profile.reliability, profile.durability) == (reliability, durability), topic
        assert (profile.history, profile.depth) == (QoSHistoryPolicy.KEEP_LAST, depth), topic
    every = {f"/cell1/{t}": qos for offered in OFFERED.values() for t, qos in offered.items()}
    for one in node.subscriptions:  # asks for no more than is offered, and for what was said before
        wanted, offered = one.qos_profile, every.get(one.topic_name, LATCHED)
        assert wanted.reliability == SENSOR[0] or offered[0] == STATE[0], one.topic_name
        assert wanted.durability == STATE[1] or offered[1] == LATCHED[1], one.topic_name
        latched = one.topic_name.removeprefix("/cell1/") in LATCHED_TOPICS
        assert not latched or wanted.durability == LATCHED[1], one.topic_name


def test_a_node_of_no_graph_keeps_the_contract(harness, tmp_path):
    check_contract(make(harness, "object_warper", tmp_path), "object_warper")


@pytest.fixture
def model(toolbox_model):
    return str(toolbox_model)


@pytest.mark.parametrize("name", sorted({*REGISTERED} - IN_NO_GRAPH))
def test_a_node_keeps_the_contract_and_may_do_what_it_does_and_hardly_more(
    harness, bag, model, tmp_path, name
):
    graph = "replay" if name == "bag_player" else "demo"
    rules = allowed(policy(graph, given(graph, bag, model=model)))[name]
    node = make(harness, name, tmp_path / "node")
    check_contract(node, name)
    publishes = {p.topic_name for p in node.publishers} - FRAMES  # where tf2_msgs is installed
    subscribes = {s.topic_name for s in node.subscriptions} - FRAMES
    offers = {s.service_name for s in node.services}
    assert publishes <= rules["publish"] and subscribes <= rules["subscribe"]
    assert offers == rules["reply"]
    assert {f"/cell1/{c.srv_name}" for c in node.clients} <= rules.get("request", set())
    later = {f"/cell1/{topic}" for topic in (*LATER.get(name, ()), "tf", "tf_static")}
    every = {"/clock", "/diagnostics", "/parameter_events"}
    below_rclpy = {"/rosout", f"/cell1/{name}/transition_event"}
    assert rules["subscribe"] - subscribes - every <= later
    assert rules["publish"] - publishes - below_rclpy - {"/clock"} <= later


@pytest.mark.parametrize("graph", GRAPHS)
def test_every_node_of_ours_has_an_enclave_of_its_own(graph, bag, model):
    root = ElementTree.fromstring(policy(graph, given(graph, bag, model=model)))
    assert root.get("version") == "0.2.0"
    paths = [enclave.get("path") for enclave in root.iter("enclave")]
    other = "lwr_sim" if "arm" in GRAPHS[graph].defaults else "arm_sim"
    ours = {n for n in GRAPHS[graph].nodes if NODES[n].package == PACKAGE and n != other}
    assert sorted(paths) == sorted(f"/cell1/{name}" for name in ours)


def test_only_who_commands_may_publish_commands_and_names_are_those_in_force(bag, model):
    text = policy("real", given("real", bag, model=model, bodies="wrist,elbow", **TOLD))
    rules = allowed(text)
    commanding = {node for node, may in rules.items() if "/arm/command" in may["publish"]}
    assert commanding == {"primitive_activation", "dashboard"}
    assert "/arm/states" in rules["intent_estimator"]["subscribe"]
    assert not any("/arm/states" in may["publish"] for may in rules.values())
    assert {"/cell1/human/elbow", "/cell1/human/wrist"} <= rules["mocap_ingest"]["publish"]
    publish_tasks = {n for n, may in rules.items() if "/cell1/intent/tasks" in may["publish"]}
    assert publish_tasks == {"intent_estimator"}


def test_what_cannot_be_is_one_line(capsys, tmp_path):
    assert main(["ward"]) == 2
    assert main(["real", "model"]) == 2
    assert main(["real", f"model:={tmp_path}/none.npz"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and "none.npz" in lines[2]


def test_named_people_have_their_topics(harness, model, tmp_path):
    path = tmp_path / "two.yaml"
    people = {"ros__parameters": {"persons": ["anna"]}}
    nodes = ("mocap_ingest", "intent_estimator", "primitive_activation", "object_transfer")
    path.write_text(yaml.safe_dump({f"/**/{name}": people for name in nodes}), encoding="utf-8")
    rules = allowed(policy("demo", {"model": model, "params_file": str(path), **ALL_ON}))
    for name in nodes:
        values = {"persons": ["anna"]} | ({"model": model} if "intent" in name else {})
        node = harness.node(partial(node_class(name), namespace="/cell1"), **values)
        publishes = {p.topic_name for p in node.publishers} - FRAMES
        subscribes = {s.topic_name for s in node.subscriptions} - FRAMES
        assert any("/anna/" in topic for topic in publishes | subscribes), name
        assert publishes <= rules[name]["publish"] and subscribes <= rules[name]["subscribe"], name
    for value, said in (("['*']", "Name everybody"), ("anna", "a list of texts, got anna")):
        path.write_text(f"/**: {{ros__parameters: {{persons: {value}}}}}", encoding="utf-8")
        with pytest.raises(ArgumentError, match=said):
            policy("demo", {"model": model, "params_file": str(path)})

# SPDX-License-Identifier: Apache-2.0
"""The reference of nodes, from the nodes themselves: each is built once, and asked what it has."""

import importlib
import json
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import learn
from intent_recognition.model import Model, save_model
from intent_recognition.share import share_path

NAMESPACE = "/elsewhere"
"""Names that do not begin with it are absolute."""

NODES = {
    "mocap_ingest": "intent_recognition.nodes",
    "intent_estimator": "intent_recognition.nodes",
    "primitive_activation": "intent_recognition.nodes",
    "task_teacher": "intent_recognition.nodes",
    "object_warper": "intent_recognition.nodes",
    "warped_primitive": "intent_recognition.nodes",
    "dashboard": "intent_recognition.dashboard",
    "bag_recorder": "intent_recognition.nodes",
    "bag_player": "intent_recognition.nodes",
    "arm_sim": "sim_bridge.nodes",
    "lwr_sim": "sim_bridge.nodes",
    "coworker_sim": "sim_bridge.nodes",
}
PURPOSES = {
    "mocap_ingest": "Checks raw tracker poses and turns them into world-frame odometry.",
    "intent_estimator": "Recognises the human's task and predicts how both agents go on.",
    "primitive_activation": "Decides when to act, and turns predictions into commands of the arm.",
    "task_teacher": "Records a demonstration while the graph runs, learns it, and hands the model"
    " to the estimator ([how](../teach.md#teach-while-it-runs)).",
    "object_warper": "Measures a seen container with the help of an annotated one"
    " ([how](../warping.md)).",
    "warped_primitive": "Plans a pour for the containers seen, from a learned one"
    " ([how](../pouring.md#in-a-graph-of-nodes)).",
    "dashboard": "Serves the web page ([what it shows](../dashboard.md)).",
    "bag_recorder": "Records topics of any type, bit for bit.",
    "bag_player": "Replays a bag on its topics in the recorded rhythm.",
    "arm_sim": "A torque-controlled arm in PyBullet, 1 kHz physics: one of four, or any URDF.",
    "lwr_sim": "`arm_sim` with the KUKA LWR 4+.",
    "coworker_sim": "A simulated worker whose wrist a simulated tracker follows.",
}
BAG = "bags/toolbox/test/plate_handover_00"
EVERY_NODES = ("/rosout", "/parameter_events", "/diagnostics")
NOT_SHOWN = ("start_type_description_service", "qos_overrides")
LIFECYCLE = "transition_event"
LIFECYCLE_SERVICES = "lifecycle_msgs/"
EVERY_NODES_SERVICES = (LIFECYCLE_SERVICES, "rcl_interfaces/", "type_description_interfaces/")
INTRODUCTION = """\
# Nodes

<!-- Written by docs/tools/write_reference.py from the running nodes; do not edit. -->

Each node was started with shipped recordings and a model of them, and asked what it has. What the \
topics mean, and what bad input gets, stands in [topics.md](../topics.md). Names are relative, \
`~/` is the node's own name, and a leading slash is absolute. All have the parameters and services \
of every ROS 2 node, `use_sim_time` among them, and publish `/diagnostics`.

A parameter marked *fixed* is read at the start; `ros2 param set` refuses it. Ranges are checked.
"""


class Declared(NamedTuple):
    """What a node declared."""

    name: str
    default: object
    descriptor: ParameterDescriptor


def nodes_page() -> str:
    """The page as Markdown."""
    with TemporaryDirectory() as folder, _running():
        overrides = _overrides(Path(folder))
        parts = [_section(name, module, overrides.get(name, {})) for name, module in NODES.items()]
    rows = [f"| [`{name}`](#{name}) | {PURPOSES[name]} |" for name in NODES]
    index = "\n".join(["| node | does |", "|---|---|", *rows])
    return "\n".join([INTRODUCTION, index + "\n", *parts])


@contextmanager
def _running() -> Iterator[None]:
    rclpy.init(args=[])
    try:
        yield
    finally:
        rclpy.try_shutdown()


def _overrides(folder: Path) -> dict[str, dict]:
    """What some nodes cannot start without, or need to use all their topics."""
    dofs = load_dofs()
    found, _ = read_demonstrations(sorted(share_path("bags/toolbox/train").iterdir())[::6], dofs)
    library = learn(found)
    model = folder / "model.npz"
    save_model(model, Model(library, dofs))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return {
        "intent_estimator": {"model": str(model)},
        "primitive_activation": {"model": str(model), "person_dofs": ["x", "y", "z"]},
        "task_teacher": {"library": str(folder / "tasks")},
        "dashboard": {"port": port, "models": str(folder)},
        "bag_player": {"bag": str(share_path(BAG)), "start_paused": True},
        "bag_recorder": {"topics": ["mocap/wrist/pose", "joint_states"]},
        "arm_sim": {"controller": "stochastic_feedback"},
        "lwr_sim": {"controller": "stochastic_feedback"},
    }


def _section(name: str, module: str, overrides: dict) -> str:
    """All about one node."""
    path = f"{module}.node" if name == "dashboard" else f"{module}.{name}"
    kind = next(
        member
        for member in vars(importlib.import_module(path)).values()
        if isinstance(member, type) and issubclass(member, Node) and member.__module__ == path
    )
    declared: list[Declared] = []
    original = Node.declare_parameter

    def remember(node, key, value=None, descriptor=None, *rest, **more):
        shown = node.get_name() == name and not key.startswith(NOT_SHOWN)
        if shown and descriptor is not None:
            declared.append(Declared(key, value, descriptor))
        return original(node, key, value, descriptor, *rest, **more)

    Node.declare_parameter = remember
    try:
        values = [Parameter(key, value=value) for key, value in overrides.items()]
        node = kind(namespace=NAMESPACE, parameter_overrides=values)
    finally:
        Node.declare_parameter = original
    try:
        parts = [f"## {name}", PURPOSES[name], _parameters(declared), _topics(node)]
        parts.append(_services(node))
    finally:
        node.destroy_node()
    return "\n\n".join(part for part in parts if part) + "\n"


def _parameters(declared: list[Declared]) -> str:
    rows = ["| parameter | type | default | range | meaning |", "|---|---|---|---|---|"]
    for name, default, descriptor in declared:
        kind, shown = _type_and_default(default)
        fixed = " *Fixed.*" if descriptor.read_only else ""
        text = descriptor.description.strip().rstrip(".").replace("|", "\\|")
        text = f"{text[:1].upper()}{text[1:]}.{fixed}"
        rows.append(f"| `{name}` | {kind} | {shown} | {_range(descriptor)} | {text} |")
    return "\n".join(rows)


def _type_and_default(default: object) -> tuple[str, str]:
    if isinstance(default, Parameter.Type):
        return default.name.lower().replace("_array", " list"), "empty"
    if isinstance(default, (list, tuple)):
        if not default:
            return "string list", "empty"
        short = [round(value, 3) if isinstance(value, float) else value for value in default]
        return f"{_type_and_default(default[0])[0]} list", f"`{json.dumps(short)}`"
    kind = {bool: "bool", int: "integer", float: "double", str: "string"}[type(default)]
    return kind, "empty" if default == "" else f"`{json.dumps(default)}`"


def _range(descriptor: ParameterDescriptor) -> str:
    for found in (*descriptor.floating_point_range, *descriptor.integer_range):
        limit = sys.float_info.max if isinstance(found.from_value, float) else 2**63 - 1
        low, high = f"{found.from_value:g}", f"{found.to_value:g}"
        if found.from_value <= -limit:
            return f"≤\u00a0{high}"
        return f"≥\u00a0{low}" if found.to_value >= limit else f"{low}\u00a0to\u00a0{high}"
    return ""


def _topics(node: Node) -> str:
    rows = {
        (direction, _relative(node, end.topic_name), _type(end.msg_type), _qos(end.qos_profile))
        for direction, ends in (("in", node.subscriptions), ("out", node.publishers))
        for end in ends
        if end.topic_name not in EVERY_NODES and not end.topic_name.endswith(LIFECYCLE)
    }
    lines = [f"| {d} | `{name}` | {kind} | {qos} |" for d, name, kind, qos in sorted(rows)]
    return "\n".join(["| | topic | type | QoS |", "|---|---|---|---|", *lines]) if lines else ""


def _services(node: Node) -> str:
    ends = [("offers", s) for s in node.services] + [("calls", c) for c in node.clients]
    rows, managed = set(), False
    for does, end in ends:
        kind = _type(end.srv_type)
        managed |= does == "offers" and kind.startswith(LIFECYCLE_SERVICES)
        if does == "calls" or not kind.startswith(EVERY_NODES_SERVICES):
            rows.add((does, _relative(node, end.srv_name), kind))
    order = sorted(rows, key=lambda row: (row[0] == "calls", row[1]))
    lines = [f"| {does} | `{name}` | {kind} |" for does, name, kind in order]
    table = ["| | service | type |", "|---|---|---|", *lines] if lines else []
    if managed:
        table += ["", "A lifecycle node: it also offers `~/change_state` and its companions."]
    return "\n".join(table).strip()


def _relative(node: Node, name: str) -> str:
    own = f"{NAMESPACE}/{node.get_name()}/"
    if name.startswith(own):
        return "~/" + name.removeprefix(own)
    return name.removeprefix(f"{NAMESPACE}/")


def _type(kind: type) -> str:
    return f"{kind.__module__.split('.')[0]}/{kind.__name__}"


def _qos(profile: QoSProfile) -> str:
    best = profile.reliability == QoSReliabilityPolicy.BEST_EFFORT
    latched = profile.durability == QoSDurabilityPolicy.TRANSIENT_LOCAL
    parts = ["best effort" if best else "reliable", *(["transient local"] if latched else [])]
    return ", ".join([*parts, f"keep last {profile.depth}"])

# SPDX-License-Identifier: Apache-2.0
"""The reference of nodes, from the nodes themselves: each is built and inspected once."""

import importlib
import json
import socket
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter

from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.learning import learn
from intent_recognition.model import Model, save_model
from intent_recognition.parameter_table import ParameterSpec, parameters_of
from intent_recognition.registry import NODES
from intent_recognition.share import share_path

NAMESPACE = "/elsewhere"
"""Names that do not begin with it are absolute."""

HOW = {
    "task_teacher": "../teach.md#teach-while-it-runs",
    "object_warper": "../warping.md",
    "object_transfer": "../transfer.md",
    "warped_primitive": "../pouring.md#in-a-graph-of-nodes",
    "dashboard": "../dashboard.md",
    "lwr_sim": "#arm_sim",
}
"""Pages with more about a node."""
BAG = "bags/toolbox/test/plate_handover_00"
EVERY_NODES = ("/rosout", "/parameter_events", "/diagnostics", f"{NAMESPACE}/clock_answers")
LIFECYCLE = "transition_event"
LIFECYCLE_SERVICES = "lifecycle_msgs/"
EVERY_NODES_SERVICES = (LIFECYCLE_SERVICES, "rcl_interfaces/", "type_description_interfaces/")
INTRODUCTION = """\
# Nodes

<!-- Written by docs/tools/write_reference.py from the running nodes; do not edit. -->

Each node was started with shipped recordings and a model of them, without tf2_msgs, moveit_msgs \
and control_msgs, and asked what it has. Names are relative, `~/` is the node's own name, and a \
leading slash is absolute. All have the parameters and services of every ROS 2 node, \
`use_sim_time` among them, and publish `/diagnostics` and `clock_answers`.

A parameter with a star is read at the start; `ros2 param set` refuses it. Ranges are checked. \
[topics.md](../topics.md) has the types of topics and services.
"""
WITHOUT = ("tf2_msgs", "moveit_msgs", "control_msgs")
"""Packages that add topics where they are installed: the page is the same everywhere."""


def nodes_page() -> str:
    """The page as Markdown."""
    sys.modules.update(dict.fromkeys(WITHOUT))
    with TemporaryDirectory() as folder, _running():
        overrides = _overrides(Path(folder))
        explained: dict[str, ParameterSpec] = {}
        parts = [_section(name, overrides.get(name, {}), explained) for name in NODES]
    return "\n".join([INTRODUCTION, *parts])


@contextmanager
def _running() -> Iterator[None]:
    rclpy.init(args=[])
    try:
        yield
    finally:
        rclpy.try_shutdown()


def _overrides(folder: Path) -> dict[str, dict]:
    """Parameters that nodes need to start, or to use all their topics."""
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
        "primitive_activation": {"model": str(model), "person_dofs": [*library.observed_names]},
        "task_teacher": {"library": str(folder / "tasks")},
        "dashboard": {"port": port, "models": str(folder)},
        "bag_player": {"bag": str(share_path(BAG)), "start_paused": True},
        "bag_recorder": {"topics": ["mocap/wrist/pose", "joint_states"]},
        "arm_sim": {"controller": "stochastic_feedback"},
        "lwr_sim": {"controller": "stochastic_feedback"},
    }


def _does(name: str) -> str:
    does = NODES[name].does
    return f"{does[:-1]} ([more]({HOW[name]}))." if name in HOW else does


def _section(name: str, overrides: dict, explained: dict[str, ParameterSpec]) -> str:
    """All about one node; `explained` has the parameters of those before it."""
    path = NODES[name].module
    kind = next(
        member
        for member in vars(importlib.import_module(path)).values()
        if isinstance(member, type) and issubclass(member, Node) and member.__module__ == path
    )
    values = [Parameter(key, value=value) for key, value in overrides.items()]
    node = kind(namespace=NAMESPACE, parameter_overrides=values)
    try:
        parts = [f"## {name}", _does(name)]
        if name != "lwr_sim":
            parts += [_parameters(parameters_of(name), explained), _topics(node), _services(node)]
    finally:
        node.destroy_node()
    return "\n\n".join(part for part in parts if part) + "\n"


def _parameters(described: Mapping[str, ParameterSpec], explained: dict[str, ParameterSpec]) -> str:
    """A table; parameters that a node before it has in the same words by name only."""
    rows = ["|parameter|default|meaning|", "|---|---|---|"]
    known = [name for name, spec in described.items() if explained.get(name) == spec]
    for name, spec in described.items():
        explained.setdefault(name, spec)
        if name in known:
            continue
        star = "" if spec.live else r"\*"
        text = spec.description.strip().rstrip(".").replace("|", "\\|")
        limits = _range(spec)
        text = f"{text[:1].upper()}{text[1:]}{f' ({limits})' if limits else ''}."
        rows.append(f"|`{name}`{star}|{_default(spec)}|{text}|")
    if known:
        rows.append(f"\nAs above: {', '.join(f'`{name}`' for name in known)}.")
    return "\n".join(rows)


def _default(spec: ParameterSpec) -> str:
    """The default of a parameter, or what type it has."""
    default = spec.default
    if isinstance(default, list):
        short = [round(value, 3) if isinstance(value, float) else value for value in default]
        return f"`{json.dumps(short)}`" if default else spec.kind.replace("_array", " list")
    return "string" if default == "" else f"`{json.dumps(default)}`"


def _range(spec: ParameterSpec) -> str:
    low, high = (None if v is None else f"{v:g}" for v in (spec.minimum, spec.maximum))
    if low is None:
        return "" if high is None else f"≤\u00a0{high}"
    return f"≥\u00a0{low}" if high is None else f"{low}\u00a0to\u00a0{high}"


def _topics(node: Node) -> str:
    lines = []
    for word, ends in (("In", node.subscriptions), ("Out", node.publishers)):
        names = {
            f"`{_relative(node, end.topic_name)}`"
            for end in ends
            if end.topic_name not in EVERY_NODES and not end.topic_name.endswith(LIFECYCLE)
        }
        lines += [f"{word}: {', '.join(sorted(names))}."] if names else []
    return " ".join(lines)


def _services(node: Node) -> str:
    lines, managed = [], False
    for word, ends in (("Offers", node.services), ("Calls", node.clients)):
        names = set()
        for end in ends:
            kind = _type(end.srv_type)
            managed |= word == "Offers" and kind.startswith(LIFECYCLE_SERVICES)
            if word == "Calls" or not kind.startswith(EVERY_NODES_SERVICES):
                names.add(f"`{_relative(node, end.srv_name)}`")
        lines += [f"{word}: {', '.join(sorted(names))}."] if names else []
    if managed:
        lines.append("A lifecycle node: it also offers `~/change_state` and its companions.")
    return " ".join(lines)


def _relative(node: Node, name: str) -> str:
    own = f"{NAMESPACE}/{node.get_name()}/"
    if name.startswith(own):
        return "~/" + name.removeprefix(own)
    return name.removeprefix(f"{NAMESPACE}/")


def _type(kind: type) -> str:
    return f"{kind.__module__.split('.')[0]}/{kind.__name__}"

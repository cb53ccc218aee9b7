# SPDX-License-Identifier: Apache-2.0
"""Checks before any node of a graph starts: a launch that fails later leaves nodes running."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from intent_recognition.errors import ArgumentError, nearest
from intent_recognition.nodes.graph import NODES, NodeCall
from intent_recognition.nodes.parameters import holds_for, sections
from intent_recognition.parameter_table import PARTS, parameters_of
from intent_recognition.share import PACKAGE, share_path
from intent_recognition.untrusted import load_yaml, read_named

NEEDS = {"sim_bridge": "pybullet", "intent_recognition.dashboard": "viser"}
"""For each package with nodes, a module that these need in addition."""
OF_EVERY_NODE = ("use_sim_time", "start_type_description_service", "qos_overrides")
"""Parameters that rclpy declares in every node (the part of the name before a dot)."""
OF_LAUNCH = ("launch-prefix", "launch-prefix-filter")
"""Arguments that every launch file has."""
FILES = ("model", "bag", "dofs", "skill")
"""Arguments that name a file or folder."""
FILES_OR_NAMES = ("sequences", "plan", "task_list", "scene")
"""Arguments that name a file if they contain a slash."""


def check_arguments(file: str, known: Sequence[str], command: Sequence[str]) -> None:
    """Refuse arguments of `ros2 launch` that the launch file does not have.

    `file` is named without `.launch.py`. A command that names another launch file, which may
    include this one and have its name, is not checked.
    """
    ours = share_path(f"launch/{file}.launch.py")
    if not any(
        (before, word) == (PACKAGE, ours.name) or Path(word).resolve() == ours.resolve()
        for before, word in pairwise(command)
    ):
        return
    for word in command:
        name, assigned, _ = word.partition(":=")
        if assigned and name not in (*known, *OF_LAUNCH):
            cure = nearest(name, known, "Leave it away.")
            expected = f"one of {', '.join(known)}"
            raise ArgumentError.about(f"argument of {file}", expected, name, cure)


def check_package(package: str, what: str) -> None:
    """Refuse an argument or launch file (`what`) that needs a package which is not installed."""
    try:
        get_package_prefix(package)
    except (PackageNotFoundError, LookupError) as error:
        cure = f"Install ros-jazzy-{package.replace('_', '-')}, or leave {what} away."
        raise ArgumentError.about(what, f"the package {package}", "none", cure) from error


def check_needs(calls: Sequence[NodeCall], values: Mapping[str, object]) -> None:
    """Refuse nodes whose package or module is missing, and arguments whose file is missing."""
    for call in calls:
        if call.package != PACKAGE:
            check_package(call.package, NODES[call.name].when)
        for room, module in NEEDS.items():
            if call.module.startswith(room) and find_spec(module) is None:
                cure = f"Install it (pip install {module}), or do without {call.name}."
                raise ArgumentError.about(call.name, f"the module {module}", "none", cure)
    if values.get("command_action") and find_spec("control_msgs") is None:
        cure = "Install ros-jazzy-control-msgs, or leave command_action empty."
        raise ArgumentError.about("command_action", "the package control_msgs", "none", cure)
    for name in (*FILES, *FILES_OR_NAMES):
        value = str(values.get(name, ""))
        is_path = name in FILES or "/" in value
        if value and is_path and not Path(value).expanduser().exists():
            got = f"{Path(value).absolute()}, which does not exist"
            raise ArgumentError.about(name, "a file or folder", got, "Correct the path.")


def check_sections(path: str, calls: Sequence[NodeCall]) -> None:
    """Refuse a parameter file with a section of no node, or a parameter unknown to its node.

    ROS itself ignores misspelt names. A section of a node that only other graphs start is allowed.
    """
    executables = {name: spec.executable or name for name, spec in NODES.items()}
    content = read_named(Path(path), "params_file", "Correct the file.", load_yaml)
    for section, values in sections(content, ""):
        last = section.rsplit("/", 1)[-1]
        executable = executables.get(last, last)
        if executable in PARTS:
            _check_names(f"params_file {path}, {last}", values, executable)
        if executable in executables.values() or any(
            holds_for(section, call.enclave) for call in calls
        ):
            continue
        cure = nearest(last, NODES, f"Nodes are {', '.join(NODES)}.")
        raise ArgumentError.about(f"params_file {path}", "sections of nodes", section, cure)


def _check_names(where: str, values: Mapping[str, object], executable: str) -> None:
    known = parameters_of(executable)
    for name in values:
        if name not in known and name.partition(".")[0] not in OF_EVERY_NODE:
            cure = nearest(name, known, f"They are {', '.join(sorted(known))}.")
            raise ArgumentError.about(where, "parameters of the node", name, cure)

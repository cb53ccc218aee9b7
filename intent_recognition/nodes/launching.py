# SPDX-License-Identifier: Apache-2.0
"""Launch descriptions of the graphs in `graph.py`. Needs ROS 2 launch."""

import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.nodes.graph import GRAPHS, NodeCall, arguments_of, resolve
from intent_recognition.nodes.launch_checks import check_arguments, check_needs, check_sections
from intent_recognition.nodes.processes import transport
from intent_recognition.share import share_path
from intent_recognition.untrusted import load_yaml, read_text

Overrides = Mapping[str, Mapping[str, object]]
RESPAWN_DELAY_S = 2.0
"""Time between the death of a node and its next start [s]. Convention."""


def describe_graph(
    graph: str,
    *,
    robot_description: Callable[[str], str] = lambda _: "",
    of_arm: Callable[[str], Overrides] = lambda _: {},
) -> LaunchDescription:
    """The arguments of a graph, and its nodes.

    Args:
        graph: one of `GRAPHS`.
        robot_description: from the argument `arm`, which may be empty, to the URDF for
            robot_state_publisher, where the graph has one.
        of_arm: likewise, to parameters that depend on the arm, by node.
    """
    spec = GRAPHS[graph]
    entities: list = []
    for argument in spec.arguments():
        default = _text(spec.defaults.get(argument.name, ""))
        given = {} if argument.needed else {"default_value": default}
        entities.append(
            DeclareLaunchArgument(argument.name, description=argument.description, **given)
        )
    entities += [SetEnvironmentVariable(*added) for added in transport(os.environ).items()]
    start = OpaqueFunction(function=_start, args=[graph, robot_description, of_arm])
    return LaunchDescription([*entities, start])


def _start(
    context: LaunchContext,
    graph: str,
    robot_description: Callable[[str], str],
    of_arm: Callable[[str], Overrides],
) -> list[Node]:
    names = [argument.name for argument in GRAPHS[graph].arguments()]
    check_arguments(graph, names, sys.argv)
    given = {name: LaunchConfiguration(name).perform(context) for name in names}
    values = arguments_of(graph, given)
    users, arm = values.get("params_file"), str(values.get("arm", ""))
    files = [str(share_path(GRAPHS[graph].params)), *([_params_file(str(users))] if users else [])]
    describe_arm = partial(robot_description, arm)
    calls = resolve(graph, given, of_arm(arm))
    check_needs(calls, values)
    if users:
        check_sections(files[-1], calls)
    return [_node(call, files, describe_arm) for call in calls]


def _node(call: NodeCall, files: list[str], robot_description: Callable[[], str]) -> Node:
    parameters = dict(call.parameters)
    if call.name == "robot_state_publisher":
        parameters["robot_description"] = robot_description()
    arguments = ["-d", str(share_path("config/intent.rviz"))] if call.name == "rviz2" else []
    typed = {name: _parameter(value) for name, value in parameters.items()}
    own = (
        [] if call.name == call.executable else [_section(file, call.executable) for file in files]
    )
    return Node(
        package=call.package,
        executable=call.executable,
        name=call.name,
        namespace=call.namespace,
        parameters=[*own, *files, typed],
        remappings=list(call.remappings),
        arguments=arguments,
        ros_arguments=["--enclave", call.enclave],  # without SROS 2 it says nothing
        output="screen",
        respawn=call.respawns,
        respawn_delay=RESPAWN_DELAY_S,
        on_exit=end_if_refused,
    )


def end_if_refused(event: Any, _context: object) -> None:
    """End the launch where a node cannot run (exit code 1): a new start would be no better."""
    if event.returncode == 1:
        raise IntentError(f"{event.process_name} cannot run; what it logged says why")


def _section(file: str, executable: str) -> dict[str, object]:
    content = load_yaml(read_text(Path(file))) or {}
    return dict(content.get(f"/**/{executable}", {}).get("ros__parameters", {}))


def _parameter(value: object) -> object:
    """Keep texts as texts: launch would convert `1` or `true`."""
    return ParameterValue(value, value_type=str) if isinstance(value, str) else value


def _params_file(name: str) -> str:
    if Path(name).is_file():
        return str(Path(name).absolute())
    try:
        return str(share_path(name))
    except IntentError as error:
        cure = "Give the path of yours, or the name of a shipped one, such as config/real_arm.yaml."
        got = f"{Path(name).absolute()}, which is none"
        raise ArgumentError.about("params_file", "a file", got, cure) from error


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)

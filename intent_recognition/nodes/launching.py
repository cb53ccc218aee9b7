# SPDX-License-Identifier: Apache-2.0
"""Launch descriptions of the graphs in `graph.py`. Needs ROS 2 launch."""

import os
import shlex
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from subprocess import run
from typing import Any

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from intent_recognition.errors import IntentError
from intent_recognition.nodes.graph import GRAPHS, NodeCall, arguments_of, resolve
from intent_recognition.nodes.launch_checks import check_arguments, check_needs, check_sections
from intent_recognition.nodes.params_files import parameters_in, params_files
from intent_recognition.nodes.processes import transport
from intent_recognition.share import share_path

QUIET = ("env", "--block-signal=INT")
"""Command that starts another one with interrupts blocked, where env is that of GNU. Until a node
unblocks them (`interrupts.end_node_at_interrupts`), Python would answer with a traceback."""
Overrides = Mapping[str, Mapping[str, object]]


def describe_graph(
    graph: str,
    *,
    robot_description: Callable[[str], str] = lambda _: "",
    of_arm: Callable[[str], Overrides] = lambda _: {},
) -> LaunchDescription:
    """Describe a graph, one of `GRAPHS`: its arguments and its nodes.

    Both functions take the argument `arm`, which may be empty: `robot_description` makes the URDF
    for robot_state_publisher, and `of_arm` the parameters that depend on the arm, by node.
    """
    spec = GRAPHS[graph]
    entities: list = []
    for argument in spec.arguments():
        default = spec.defaults.get(argument.name, "")
        text = str(default).lower() if isinstance(default, bool) else str(default)
        given = {} if argument.needed else {"default_value": text}
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
    outer = context.launch_configurations.get("ros_namespace", "")  # that of PushRosNamespace
    given["namespace"] = "/".join(filter(None, (outer.strip("/"), given["namespace"].strip("/"))))
    values = arguments_of(graph, given)
    files, arm = params_files(graph, values), str(values.get("arm", ""))
    describe_arm = partial(robot_description, arm)
    calls = resolve(graph, given, of_arm(arm))
    check_needs(calls, values)
    for users in files[1:]:
        check_sections(users, calls)
    prefix = _prefix(context)
    return [_node(call, files, describe_arm, prefix if call.module else None) for call in calls]


def _prefix(context: LaunchContext) -> str | None:
    """`QUIET`; None where env has no such option, or a prefix is given, such as a debugger."""
    if "launch-prefix" not in context.launch_configurations:
        with suppress(OSError):
            if run([*QUIET, "true"], capture_output=True).returncode == 0:
                return shlex.join(QUIET)
    return None


def _node(
    call: NodeCall, files: list[str], robot_description: Callable[[], str], prefix: str | None
) -> Node:
    parameters = dict(call.parameters)
    if call.name == "robot_state_publisher":
        parameters["robot_description"] = robot_description()
    arguments = ["-d", str(share_path("config/intent.rviz"))] if call.name == "rviz2" else []
    typed = {  # texts stay texts: launch would convert `1` or `true`
        name: ParameterValue(value, value_type=str) if isinstance(value, str) else value
        for name, value in parameters.items()
    }
    of_executable = replace(call, name=call.executable)
    own = [parameters_in(files, of_executable)] if call.name != call.executable else []
    return Node(
        package=call.package,
        executable=call.executable,
        name=call.name,
        namespace=f"/{call.namespace}",
        parameters=[*own, *files, typed],
        remappings=list(call.remappings),
        arguments=arguments,
        exec_name=call.name,
        prefix=prefix,
        ros_arguments=["--enclave", call.enclave],  # no effect without SROS 2
        output="screen",
        respawn=call.respawns,
        respawn_delay=2.0,
        on_exit=end_if_refused,
    )


def end_if_refused(event: Any, _context: object) -> None:
    """End the launch if a node cannot run (exit code 1), since a restart would not help."""
    if event.returncode == 1:
        raise IntentError(f"{event.process_name} cannot run; what it logged says why")

# SPDX-License-Identifier: Apache-2.0
"""Add, list or remove via points: places or joint values through which the robot passes until they
are removed. Needs ROS 2 and a running estimator.

# over the bottle, in the middle of the way
intent via add bottle --hand 0.45 0.1 0.4 --phase 0.5 --task plate_handover
# another end
intent via add end --hand 0.5 -0.2 0.3 --phase 1 --std 0.005
# a joint, 2 s after the onset
intent via add elbow --dof lwr_a4_joint=-1.2 --time 2 --std 0.05
# which there are
intent via list
# no more
intent via remove bottle
"""

import argparse
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from intent_recognition.cli.console import busy, make_console, say
from intent_recognition.cli.options import (
    add_actions,
    add_command,
    add_node_options,
    add_options,
    node_arguments,
    number,
)
from intent_recognition.composing import USUAL_STD, ViaPoint, read_via_points, write_via_points
from intent_recognition.errors import ArgumentError, ResourceBusyError, printable

ESTIMATOR = "intent_estimator"

Points = tuple[ViaPoint, ...]
Change = Callable[[argparse.Namespace, Points], Sequence[ViaPoint]]


def _add_actions(parser: argparse.ArgumentParser) -> None:
    actions = add_actions(parser)
    add = add_command(
        actions,
        "add",
        partial(_run, _add),
        """
        Add a point, or replace the one of the same name.

        name NAME    name of the point
        --task TASK  task that it is for (default: all tasks)
        --std STD    how exactly: standard deviation, in the unit of the value (default:
                     %(default)s)
        """,
        task={"default": ""},
        std={"type": number(float, 0.0), "default": USUAL_STD},
    )
    add_options(
        add.add_mutually_exclusive_group(required=True),
        """
        --hand X Y Z      place of the hand in the world frame [m]
        --dof NAME=VALUE  value of a controlled DOF, in its unit; may be repeated
        """,
        hand=number(float, -1e3),
        dof={"action": "append", "type": _dof},
    )
    add_options(
        add.add_mutually_exclusive_group(required=True),
        """
        --phase P  share of the movement, 1 is its end
        --time S   time after the onset, at the usual pace [s]
        """,
        phase=number(float, 0.0, 1.0),
        time=number(float, 0.0),
    )
    show = partial(_run, lambda _, points: points)
    listed = add_command(actions, "list", show, "Print the points in force.")
    text = """
        Remove points, by name or all.

        names NAME  names of the points
        --all       remove all points
        """
    remove = add_command(actions, "remove", partial(_run, _remove), text, names={"nargs": "*"})
    for action in (add, listed, remove):
        add_node_options(action)


MORE = (_add_actions,)


def _run(change: Change, args: argparse.Namespace) -> int:
    """Read what is in force, change it, and print it."""
    from rclpy.node import Node

    from intent_recognition.nodes.runtime import spinning

    console = make_console()
    words = node_arguments(args, {})
    with (
        spinning(lambda: Node("via_points"), words) as (node, executor),
        busy(console, "asking the estimator"),
    ):
        points = change_via_points(node, executor, partial(change, args))
    for point in points:
        say(console, printable(str(point)))
    if not points:
        console.print("no via points")
    return 0


def change_via_points(
    node: Any, executor: Any, change: Callable[[Points], Sequence[ViaPoint]]
) -> Points:
    """Read the via points of the estimator, and set what the change makes of them."""
    from rcl_interfaces.srv import GetParameters, SetParameters
    from rclpy.parameter import Parameter

    from intent_recognition.nodes.runtime import spin_until
    from intent_recognition.nodes.via_points import VIA_POINTS

    def ask(kind: Any, name: str, request: Any, within_s: float = 10.0) -> Any:
        client = node.create_client(kind, f"{ESTIMATOR}/{name}")
        if spin_until(executor, client.service_is_ready, within_s):
            future = client.call_async(request)
            if spin_until(executor, future.done, within_s):
                return future.result()
        cure = "Start it with the same ROS_DOMAIN_ID, or name its --namespace."
        raise ResourceBusyError.about(ESTIMATOR, "a running node", "no answer", cure)

    answer = ask(GetParameters, "get_parameters", GetParameters.Request(names=[VIA_POINTS]))
    before = read_via_points(answer.values[0].string_value if answer.values else "")
    after = tuple(change(before))
    if after != before:
        value = Parameter(VIA_POINTS, value=write_via_points(after)).to_parameter_msg()
        request = SetParameters.Request(parameters=[value])
        (result,) = ask(SetParameters, "set_parameters", request).results
        if not result.successful:
            raise ArgumentError(result.reason)
    return after


def _add(args: argparse.Namespace, points: Points) -> Sequence[ViaPoint]:
    names = [name for name, _ in args.dof or ()]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        cure = "Give each DOF once."
        raise ArgumentError.about("--dof", "different names", ", ".join(doubled), cure)
    values = {"hand": tuple(args.hand)} if args.hand else {n: (v,) for n, v in args.dof}
    std = (args.std,) * sum(map(len, values.values()))
    new = ViaPoint(args.name, values, std, args.phase, args.time, args.task)
    return read_via_points(
        write_via_points([*(point for point in points if point.name != args.name), new])
    )


def _remove(args: argparse.Namespace, points: Points) -> Sequence[ViaPoint]:
    known = [point.name for point in points]
    missing = [name for name in args.names if name not in known]
    if missing or not (args.names or args.all):
        expected = f"names of via points ({', '.join(known) or 'there are none'}), or --all"
        cure = "`intent via list` shows them."
        raise ArgumentError.about("NAME", expected, ", ".join(missing) or "nothing", cure)
    return [point for point in points if not args.all and point.name not in args.names]


def _dof(text: str) -> tuple[str, float]:
    name, _, value = text.rpartition("=")
    try:
        number = float(value)
    except ValueError:
        name, number = "", math.nan
    if not name or not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"expected NAME=NUMBER, got {text}")
    return name, number

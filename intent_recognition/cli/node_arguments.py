# SPDX-License-Identifier: Apache-2.0
"""The command line of a node, from the options of a command."""

import argparse
import json
from collections.abc import Mapping


def add_node_options(parser: argparse.ArgumentParser) -> None:
    """Options every command that runs a node has: namespace and remapping."""
    group = parser.add_argument_group("topics")
    group.add_argument("--namespace", default="", metavar="NS", help="namespace of the topics")
    group.add_argument(
        "--remap",
        action="append",
        default=[],
        metavar="FROM:=TO",
        help="use another topic name; may be repeated",
    )


def node_arguments(args: argparse.Namespace, parameters: Mapping[str, object]) -> list[str]:
    """`--ros-args` of a node; the first entry stands for the program's name."""
    command = ["intent", "--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={yaml_value(value)}"]
    if args.namespace:
        command += ["-r", f"__ns:=/{args.namespace.strip('/')}"]
    for rule in args.remap:
        command += ["-r", rule]
    return command


def yaml_value(value: object) -> str:
    """A parameter's value such that its type is kept: texts quoted, floats with a point."""
    return json.dumps(value, ensure_ascii=False)

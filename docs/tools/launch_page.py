# SPDX-License-Identifier: Apache-2.0
"""The reference of launch files, from the graphs that they and `intent demo` start."""

from intent_recognition.nodes.arguments import Argument
from intent_recognition.nodes.graph import GRAPHS, NODES, GraphSpec

INTRODUCTION = """\
# Launch files

<!-- Written by docs/tools/write_reference.py from nodes/graph.py; do not edit. -->

`ros2 launch intent_recognition NAME.launch.py ARGUMENT:=VALUE ...`; `--show-args` says the same \
in the terminal. What is not given is taken from the parameter file, then from the node's default.
"""
KINDS = {tuple: "list, separated by commas", str: "text", bool: "true or false", int: "integer"}


def launch_page() -> str:
    """The page as Markdown."""
    return "\n".join([INTRODUCTION, *(_section(name, spec) for name, spec in GRAPHS.items())])


def _section(name: str, spec: GraphSpec) -> str:
    nodes = ", ".join(map(_node, spec.nodes))
    rows = [_row(argument, spec) for argument in spec.arguments()]
    table = "\n".join(["| argument | type | default | meaning |", "|---|---|---|---|", *rows])
    return f"## {name}.launch.py\n\nStarts {nodes}.\n\n{table}\n"


def _node(name: str) -> str:
    shown = f"`{name}`"
    if NODES[name].module:
        shown = f"[{shown}](nodes.md#{NODES[name].executable or name})"
    return f"{shown} (with `{NODES[name].when}`)" if NODES[name].when else shown


def _row(argument: Argument, spec: GraphSpec) -> str:
    default = spec.defaults.get(argument.name, "")
    shown = str(default).lower() if isinstance(default, bool) else str(default)
    shown = "**needed**" if argument.needed else f"`{shown}`" if shown else ""
    kind = KINDS.get(argument.kind, "number")
    return f"| `{argument.name}` | {kind} | {shown} | {argument.description} |"

# SPDX-License-Identifier: Apache-2.0
"""The reference of launch files, from the graphs that they and `intent demo` start."""

from intent_recognition.nodes.arguments import Argument
from intent_recognition.nodes.graph import GRAPHS, NODES, GraphSpec
from intent_recognition.share import PACKAGE

INTRODUCTION = """\
# Launch files

<!-- Written by docs/tools/write_reference.py from nodes/graph.py; do not edit. -->

`ros2 launch intent_recognition NAME.launch.py ARGUMENT:=VALUE ...`; `--show-args` says the same \
in the terminal. Defaults stand behind the names. What has none and is not given is taken from the \
parameter file, then from the node's default. All launch files take {everywhere}.
"""
KINDS = {tuple: "list", str: "text", bool: "bool", int: "integer"}


def launch_page() -> str:
    """The page as Markdown."""
    arguments = {a.name: a for spec in GRAPHS.values() for a in spec.arguments()}
    rows = [f"|`{a.name}`|{_kind(a)}|{a.description}|" for a in arguments.values()]
    table = "\n".join(["## Arguments\n", "|argument|type|meaning|", "|---|---|---|", *rows])
    taken = [[_given(a, spec) for a in spec.arguments()] for spec in GRAPHS.values()]
    everywhere = [shown for shown in taken[0] if all(shown in others for others in taken)]
    sections = [_section(name, everywhere) for name in GRAPHS]
    return "\n".join([INTRODUCTION.format(everywhere=", ".join(everywhere)), *sections, table, ""])


def _section(name: str, everywhere: list[str]) -> str:
    """The nodes of a launch file, and its arguments with their defaults."""
    spec = GRAPHS[name]
    first, left = next(
        (other, left)
        for other, graph in GRAPHS.items()
        if set(spec.nodes) <= set(graph.nodes)
        and len(left := set(graph.nodes) - set(spec.nodes)) < 2
    )
    known = [_given(a, GRAPHS[first]) for a in GRAPHS[first].arguments()]
    shown = [_given(a, spec) for a in spec.arguments()]
    title = f"## {name}.launch.py\n\n"
    if first != name:
        other = ", ".join(one for one in shown if one not in known)
        less = "".join(f", and without `{node}`" for node in left)
        return f"{title}Starts and takes the same as {first}.launch.py, but for {other}{less}.\n"
    nodes = ", ".join(map(_node, spec.nodes))
    takes = ", ".join(one for one in shown if one not in everywhere)
    return f"{title}Starts {nodes}.\n\nTakes {takes}.\n"


def _given(argument: Argument, spec: GraphSpec) -> str:
    """Name and default of an argument, as they are written in the terminal."""
    default = spec.defaults.get(argument.name, "")
    shown = str(default).lower() if isinstance(default, bool) else str(default)
    needed = " (needed)" if argument.needed else ""
    return f"`{argument.name}{f':={shown}' if shown else ''}`{needed}"


def _kind(argument: Argument) -> str:
    return KINDS.get(argument.kind, "number")


def _node(name: str) -> str:
    shown = f"`{name}`"
    if NODES[name].package == PACKAGE:
        shown = f"[{shown}](nodes.md#{NODES[name].executable or name})"
    return f"{shown} (with `{NODES[name].when}`)" if NODES[name].when else shown

# SPDX-License-Identifier: Apache-2.0
"""The executables of the nodes: they start a node, or print its help or what it lacks.

Imports begin once interrupts no longer leave a traceback.
"""

import sys
from collections.abc import Callable, Sequence
from functools import partial

from intent_recognition.interrupts import end_node_at_interrupts

HELP = """\
{name}: {does}

usage: {name} [--ros-args [-p NAME:=VALUE ...] [-r FROM:=TO ...] [--params-file FILE]]
       ros2 run intent_recognition {name} [--ros-args ...]

Its parameters, topics and services are listed in docs/reference/nodes.md, and by
`ros2 param list /{name}` while it runs.
"""


def __getattr__(name: str) -> Callable[..., int]:
    """Entry point of a node's executable, such as `start.mocap_ingest()`."""
    from intent_recognition.registry import NODES

    if name not in NODES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(start, name)


def start(name: str, args: Sequence[str] | None = None) -> int:
    """Run the node of this name; interrupts are quiet from its first import on.

    Returns:
        The exit code: 1 with one line on stderr if a package is missing, such as ROS 2.
    """
    if args is None:
        end_node_at_interrupts()
    import importlib

    from intent_recognition.registry import NODES

    try:
        node = importlib.import_module(NODES[name].module)
    except ImportError as error:
        tell_missing(name, error)
        return 1
    words = (sys.argv if args is None else args)[1:]
    if {"-h", "--help"} & set(words):
        sys.stdout.write(HELP.format(name=name, does=NODES[name].does))
        return 0
    if words[:1] not in ([], ["--ros-args"]):  # rclpy would ignore them
        sys.stderr.write(f"{name}: expected --ros-args first, got {words[0]}. See --help.\n")
        return 1
    return int(node.main(args))


def tell_missing(name: str, error: ImportError) -> None:
    """Say on stderr which package is missing.

    Raises:
        ImportError: `error` has another cause.
    """
    from intent_recognition.errors import missing_package, one_line

    if (missing := missing_package(error)) is None:
        raise error
    sys.stderr.write(f"{name}: {one_line(missing)}\n")

# SPDX-License-Identifier: Apache-2.0
"""The executables of the nodes: they start a node, or say what it is or what is missing for it."""

import importlib
import re
import sys
from collections.abc import Sequence
from functools import partial

from intent_recognition.errors import missing_package, one_line

HELP = """\
{name}: {does}

usage: {name} [--ros-args [-p NAME:=VALUE ...] [-r FROM:=TO ...] [--params-file FILE]]
       ros2 run intent_recognition {name} [--ros-args ...]

Its parameters, topics and services are listed in docs/reference/nodes.md, and by
`ros2 param list /{name}` while it runs.
"""


def start(module: str, args: Sequence[str] | None = None) -> int:
    """Run the node `main` of a module, which has the node's name.

    Args:
        module: of the node; the first line of its docstring says what it does.
        args: command line with the program's name first; None takes the process's own.

    Returns:
        The exit code: 1 with one line on stderr where there is no ROS 2.
    """
    name = module.rpartition(".")[2]
    try:
        node = importlib.import_module(module)
    except ImportError as error:
        tell_missing(name, error)
        return 1
    if explained(name, node.__doc__ or "", args):
        return 0
    return int(node.main(args))


def tell_missing(name: str, error: ImportError) -> None:
    """Say on stderr that ROS 2 is missing.

    Raises:
        ImportError: something else is.
    """
    if (told := missing_package(error)) is None:
        raise error
    sys.stderr.write(f"{name}: {one_line(told)}\n")


def explained(name: str, docstring: str, args: Sequence[str] | None) -> bool:
    """Print what a node does and how it is started, if the command line asks for help."""
    if not {"-h", "--help"} & set((sys.argv if args is None else args)[1:]):
        return False
    does = re.sub("^(Node|The node `[a-z_]+`): ", "", docstring.partition("\n")[0])
    sys.stdout.write(HELP.format(name=name, does=does))
    return True


mocap_ingest = partial(start, "intent_recognition.nodes.mocap_ingest")
intent_estimator = partial(start, "intent_recognition.nodes.intent_estimator")
primitive_activation = partial(start, "intent_recognition.nodes.primitive_activation")
bag_recorder = partial(start, "intent_recognition.nodes.bag_recorder")
bag_player = partial(start, "intent_recognition.nodes.bag_player")
object_warper = partial(start, "intent_recognition.nodes.object_warper")
task_teacher = partial(start, "intent_recognition.nodes.task_teacher")
warped_primitive = partial(start, "intent_recognition.nodes.warped_primitive")

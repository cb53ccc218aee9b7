# SPDX-License-Identifier: Apache-2.0
"""Record demonstrations of a task while the nodes run. Each is learned as soon as its recording
ends, and a running estimator uses it at once. Needs ROS 2.

task TASK    label of the task
--seconds S  length of each recording [s]; without it Enter begins and ends one
--count N    number of demonstrations (default: until q is entered)

# Enter begins and ends each demonstration
intent teach give_bracket --library tasks --model bracket.npz
# one of five seconds, without questions
intent teach give_bracket --library tasks --seconds 5
"""

import argparse
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from intent_recognition.cli.console import busy, make_console, say
from intent_recognition.cli.options import add_node_options, add_options, node_arguments, number
from intent_recognition.errors import BagError, IntentError, ResourceBusyError
from intent_recognition.model import TaskFolder, is_task_folder, library_dofs, load_model

if TYPE_CHECKING:
    from intent_recognition.nodes.task_teacher import TaskTeacher

DISCOVERY_S = 5.0
"""Longest wait for the topics to record [s]."""
HANDED_OVER_S = 12.0
"""Longest wait for a running estimator to load a model [s]; the teacher asks again after 5 s."""
DEFAULT_LIBRARY = Path("tasks")
QUIT = "q"

Spin = Callable[[Callable[[], object], float], bool]
"""Runs callbacks until a condition holds or a time [s] has passed; returns whether it holds."""


def add_library_options(
    parser: argparse.ArgumentParser, default: Path | None = DEFAULT_LIBRARY
) -> None:
    """Add the options of commands that work on a library of tasks."""
    add_options(
        parser,
        f"""
        --library DIR  library of tasks: a folder of recordings, model and history (default:
                       {DEFAULT_LIBRARY})
        --model M.npz  model that a new library begins with; refused where the library has another
        --dofs F       DOF file of a new library that begins without a model; refused where the
                       library has others
        """,
        library={"default": default},
    )
    add_node_options(parser)


OPTIONS = {"seconds": number(float, 0.1), "count": {"type": number(int, 0), "default": 0}}
MORE = (add_library_options,)


def run(args: argparse.Namespace) -> int:
    """Record, learn, send the model; 1 if nothing was learned."""
    console = make_console()
    refuse_other_model(args.library, args.model, args.dofs)
    with busy(console, "waiting for the topics"):
        _wait_for_topics(args)
    with teacher_node(args, task=args.task) as (teacher, spin):
        spin(lambda: len(teacher.listening) == len(teacher.wanted), DISCOVERY_S)
        say(console, f"library {teacher.folder.path}")
        learned = _teach(args, teacher, spin, console)
    return 0 if learned else 1


@contextmanager
def teacher_node(args: argparse.Namespace, task: str = "") -> Iterator[tuple["TaskTeacher", Spin]]:
    """A task_teacher in this process, and a function that runs its callbacks.

    The command prints its results; the node itself logs only warnings.
    """
    from intent_recognition.nodes.runtime import spin_until, spinning
    from intent_recognition.nodes.task_teacher import TaskTeacher

    chosen: dict[str, object] = {**_paths(args), "task": task, "executions": 0}
    words = [*node_arguments(args, chosen), "--log-level", "warn"]
    with spinning(TaskTeacher, words) as (node, executor):
        yield node, partial(spin_until, executor)


def wait_until_used(teacher: "TaskTeacher", spin: Spin, console: Console, what: str) -> str:
    """Wait until a running estimator uses the model; return its status, or `what`."""
    with busy(console, "sending the model"):
        if not spin(lambda: not teacher.sending_model, HANDED_OVER_S):
            return f"{what}; the estimator has not answered"
    return teacher.last_status or what


def _paths(args: argparse.Namespace) -> dict[str, str]:
    """The given ones of library, model and DOF file, as absolute paths."""
    names = ("library", "model", "dofs")
    return {name: str(path.absolute()) for name in names if (path := getattr(args, name))}


def refuse_other_model(library: Path, model: Path | None, dofs: Path | None) -> None:
    """Refuse a model other than the one with which an existing library began."""
    if not is_task_folder(library):
        return
    folder = TaskFolder(library, library_dofs(library, model or "", dofs or ""))
    if model and folder.model_path.exists() and not folder.began_with(model):
        load_model(model)
        expected = f"the model that {library} began with, or none"
        cure = "Leave it out to go on with that library, or name a new --library."
        raise ResourceBusyError.about("--model", expected, model, cure)


def _wait_for_topics(args: argparse.Namespace) -> None:
    """Wait for publishers of the topics to record, before anything is written."""
    from rclpy.node import Node

    from intent_recognition.demonstrations import topics_of
    from intent_recognition.nodes.runtime import spin_until, spinning

    wanted = topics_of(library_dofs(**_paths(args)))
    words = [*node_arguments(args, {}), "--log-level", "warn"]
    with spinning(partial(Node, "intent_teach"), words) as (node, executor):
        topics = [node.resolve_topic_name(topic) for topic in wanted]

        def silent() -> list[str]:
            return sorted(topic for topic in topics if not node.count_publishers(topic))

        if spin_until(executor, lambda: not silent(), DISCOVERY_S):
            return
        expected = f"publishers of {', '.join(silent())}"
    cure = "Start the tracker and the arm, or remap the topics."
    raise BagError.about("topics", expected, "none", cure)


def _teach(args: argparse.Namespace, teacher: "TaskTeacher", spin: Spin, console: Console) -> int:
    """Record and learn demonstrations one after another; return the number learned."""
    lines = None if args.seconds else _InputLines()
    learned = shown = 0
    while not args.count or shown < args.count:
        if lines and not _asked(lines, spin, console, f"Enter: record {args.task}, {QUIT}: end"):
            break
        shown += 1
        teacher.start()
        if lines is None:
            with busy(console, f"recording {args.task} for {args.seconds:g} s"):
                spin(lambda: False, args.seconds)
        elif not _asked(lines, spin, console, f"recording; Enter: done, {QUIT}: throw away"):
            say(console, teacher.discard())
            continue
        try:
            with busy(console, "learning"):
                what = teacher.stop()
        except IntentError as error:
            say(console, error, "yellow")
            continue
        learned += 1
        say(console, wait_until_used(teacher, spin, console, what))
        if lines is None and not args.count:
            break
    return learned


def _asked(lines: "_InputLines", spin: Spin, console: Console, question: str) -> bool:
    """Ask and wait for a line; False if it is `q` or the input has ended."""
    console.print(question)
    spin(lambda: lines.ready, float("inf"))
    return lines.take() not in (QUIT, None)


class _InputLines:
    """Lines of standard input, read in a separate thread; None at the end."""

    def __init__(self) -> None:
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read, name="stdin", daemon=True).start()

    @property
    def ready(self) -> bool:
        return not self._lines.empty()

    def take(self) -> str | None:
        line = self._lines.get()
        if line is None:
            self._lines.put(None)
        return line

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line.strip())
        self._lines.put(None)

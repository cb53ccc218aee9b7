# SPDX-License-Identifier: Apache-2.0
"""`intent undo`: take the last demonstration back, also from the running graph."""

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from rich.console import Console

from intent_recognition.cli.console import busy, make_console
from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers
from intent_recognition.cli.teach import add_library_options, teacher_node, wait_until_used

if TYPE_CHECKING:
    from intent_recognition.nodes.task_teacher import TaskTeacher

FOUND_S = 2.0
"""Longest wait for a running estimator [s]. Convention."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "undo",
        help="take the last demonstration or correction of a library back",
        description="Take the last demonstration that `intent teach` learned, or correction that"
        " `intent keep` kept, back: the model before"
        " it returns, a running estimator loads it, and the recording is kept in `undone`.",
        **examples(
            ("take the last demonstration back", "intent undo --library tasks"),
        ),
    )
    add_library_options(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Take it back.

    Raises:
        ModelError: there is nothing to take back.
    """
    change_library(args, make_console(), lambda teacher: teacher.undo())
    return 0


def change_library(
    args: argparse.Namespace, console: Console, change: Callable[["TaskTeacher"], str]
) -> None:
    """Change the library, give the model to a running estimator, and print how it went."""
    with teacher_node(args) as (teacher, spin):
        with busy(console, "looking for the estimator"):
            spin(teacher.estimator_runs, FOUND_S)
        wait_until_used(teacher, spin, console, change(teacher))

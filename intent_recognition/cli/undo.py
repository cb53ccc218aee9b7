# SPDX-License-Identifier: Apache-2.0
"""Take back the last change of a library, by `intent teach` or `intent keep`. A running estimator
loads the model before it, and the recording moves to the folder `undone`. Needs ROS 2.

# take the last demonstration back
intent undo --library tasks
"""

import argparse

from intent_recognition.cli.console import busy, make_console, say
from intent_recognition.cli.teach import (
    add_library_options,
    refuse_other_model,
    teacher_node,
    wait_until_used,
)
from intent_recognition.errors import ModelError
from intent_recognition.model import is_task_folder

FOUND_S = 5.0
"""Longest wait for a running estimator [s]; discovery takes more than 2 on a busy machine."""


MORE = (add_library_options,)


def run(args: argparse.Namespace) -> int:
    """Change the library as the command says, and hand the model to a running estimator."""
    if not is_task_folder(args.library):
        came = "another folder" if args.library.is_dir() else "none"
        cure = "Name the one that `intent teach` or task_teacher made."
        raise ModelError.about(f"--library {args.library}", "a folder of tasks", came, cure)
    refuse_other_model(args.library, args.model, args.dofs)
    console = make_console()
    with teacher_node(args) as (teacher, spin):
        with busy(console, "looking for the estimator"):
            spin(teacher.estimator_runs, FOUND_S)
        change = {"keep": teacher.keep, "undo": teacher.undo}[args.command]
        say(console, wait_until_used(teacher, spin, console, change()))
    return 0

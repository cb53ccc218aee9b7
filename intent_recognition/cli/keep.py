# SPDX-License-Identifier: Apache-2.0
"""`intent keep`: what a person corrected by hand becomes a part of the task."""

from intent_recognition.cli.options import Subparsers, add_command
from intent_recognition.cli.teach import add_library_options
from intent_recognition.cli.undo import change_library


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = add_command(
        subparsers,
        "keep",
        change_library,
        """
        Learn from the last execution of a task in which a person pushed or guided the arm: from now
        on the robot moves as corrected. A running estimator loads the new model, and other tasks
        stay as they are. `intent undo` takes the change back. A running task_teacher must have
        recorded the execution (docs/correcting.md). Needs ROS 2.

        # keep the last correction
        intent keep --library tasks
        """,
    )
    add_library_options(parser)

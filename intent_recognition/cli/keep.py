# SPDX-License-Identifier: Apache-2.0
"""`intent keep`: what a person corrected by hand becomes a part of the task."""

from intent_recognition.cli.help import examples
from intent_recognition.cli.options import Subparsers
from intent_recognition.cli.teach import add_library_options
from intent_recognition.cli.undo import change_library


def add_parser(subparsers: Subparsers) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "keep",
        description="Learn from the last execution of a task in which a person pushed or guided the"
        " arm: from now on the robot moves as corrected. A running estimator loads the new model,"
        " and other tasks stay as they are. `intent undo` takes the change back. A running"
        " task_teacher must have recorded the execution (docs/correcting.md). Needs ROS 2.",
        **examples(("keep the last correction", "intent keep --library tasks")),
    )
    add_library_options(parser)
    parser.set_defaults(run=change_library)

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
        help="keep the last correction by hand: its task moves",
        description="Keep the last execution that a person corrected by hand as a demonstration:"
        " the robot's part of the task moves there, a running estimator loads the"
        " model, and other tasks stay as they are. `intent undo` takes it back. Executions are"
        " recorded by a running task_teacher.",
        **examples(
            ("keep the last correction", "intent keep --library tasks"),
        ),
    )
    add_library_options(parser)
    parser.set_defaults(run=change_library)

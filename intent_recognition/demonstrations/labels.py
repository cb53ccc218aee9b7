# SPDX-License-Identifier: Apache-2.0
"""Labels of recordings are checked before they name anything."""

from dataclasses import replace

from intent_recognition.errors import BagError
from intent_recognition.signals import LABEL, LONGEST_LABEL, Rejection, can_name_task


def check_label(label: str, cure: str = "Give one such as give_cup.") -> None:
    """Make sure that a text can name a task.

    Raises:
        BagError: it is empty, too long, means no task, or holds what a folder or a terminal
            cannot show.
    """
    if not can_name_task(label):
        shown = repr(label[:LONGEST_LABEL]) + ("..." if len(label) > LONGEST_LABEL else "")
        raise BagError.about("task", LABEL, shown, cure)


def label_problem(label: str, path: str, topic: str = "", stamp_ns: int = 0) -> Rejection | None:
    """Why the label of a recording cannot name a task; None if it can."""
    try:
        check_label(label)
    except BagError as error:
        return replace(Rejection.of(path, error, "label", stamp_ns), topic=topic)
    return None

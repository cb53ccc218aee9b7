# SPDX-License-Identifier: Apache-2.0
"""Labels of recordings are checked before they name anything."""

from intent_recognition.errors import BagError
from intent_recognition.signals import LABEL, LONGEST_LABEL, can_name_task


def check_label(label: str, cure: str = "Give one such as give_cup.") -> None:
    """Make sure that a text can name a task.

    Args:
        label: the text.
        cure: what helps where it cannot.

    Raises:
        BagError: it is empty, too long, means no task, or holds what a folder or a terminal
            cannot show.
    """
    if not can_name_task(label):
        shown = repr(label[:LONGEST_LABEL]) + ("..." if len(label) > LONGEST_LABEL else "")
        raise BagError.about("task", LABEL, shown, cure)


def label_problem(label: str) -> str:
    """What is wrong with a label that a recording has; empty if nothing is."""
    try:
        check_label(label)
    except BagError as error:
        return f"label: {error}"
    return ""

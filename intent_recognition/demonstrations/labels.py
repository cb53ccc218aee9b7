# SPDX-License-Identifier: Apache-2.0
"""What may be the label of a task: it names folders, parameters and lines on a terminal."""

from intent_recognition.errors import BagError

LONGEST = 80
"""Characters of a label; with a number behind it a file system takes 255 bytes. Convention."""
FORBIDDEN = frozenset("/\\\0")
NO_TASK = "none"


def check_label(label: str) -> None:
    """Make sure that a text can name a task.

    Raises:
        BagError: it is empty, too long, means no task, or holds what a folder or a terminal
            cannot show.
    """
    sound = label.isprintable() and label == label.strip() and not FORBIDDEN & set(label)
    if not label or len(label) > LONGEST or label[0] in ".-" or label == NO_TASK or not sound:
        expected = f"a label that can name a folder, of 1 to {LONGEST} characters"
        shown = repr(label[:LONGEST]) + ("..." if len(label) > LONGEST else "")
        raise BagError.about("task", expected, shown, "Give one such as give_cup.")


def label_problem(label: str) -> str:
    """What is wrong with a label that a recording has; empty if nothing is."""
    try:
        check_label(label)
    except BagError as error:
        return f"label: {error}"
    return ""

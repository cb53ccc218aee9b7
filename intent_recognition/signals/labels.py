# SPDX-License-Identifier: Apache-2.0
"""Labels of tasks, which name folders, parameters and lines on a terminal, and of people."""

NONE = "none"
"""Label of the hypothesis that a movement is none of the known tasks; no task may have it."""
LONGEST_LABEL = 80
"""Characters of a label; with a number behind it a file system takes 255 bytes. Convention."""
GROUP = "group"
"""Key of a recording's metadata that says whose it is."""
FORBIDDEN = frozenset("/\\\0")
LABEL = f"a label that can name a folder, of 1 to {LONGEST_LABEL} characters, other than {NONE!r}"
"""What `can_name_task` asks for, in words."""


def can_name_task(label: object) -> bool:
    """Whether something can be the label of a task: see `LABEL`."""
    return (
        isinstance(label, str)
        and 1 <= len(label) <= LONGEST_LABEL
        and label.isprintable()
        and label == label.strip()
        and label[0] not in ".-"
        and label != NONE
        and not FORBIDDEN & set(label)
    )

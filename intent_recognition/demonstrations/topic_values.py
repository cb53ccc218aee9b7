# SPDX-License-Identifier: Apache-2.0
"""Values of degrees of freedom in the messages of one topic, by columns or message by message."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.bags import JOINT_STATE, POSE, Columns, PoseColumns
from intent_recognition.demonstrations.dofs import DofEntry, extract
from intent_recognition.errors import MessageError

POSITION_FIELDS = tuple(f"pose.position.{axis}" for axis in "xyz")
ORIENTATION_FIELDS = tuple(f"pose.orientation.{axis}" for axis in "xyzw")
Content = Columns | Sequence[object]
"""What a topic's messages hold: columns, or the decoded messages one by one."""


def has_columns(entry: DofEntry) -> bool:
    """Whether all that the entry asks for stands in the columns of its type."""
    if entry.type == POSE:
        return set(entry.fields) <= {*POSITION_FIELDS, *ORIENTATION_FIELDS}
    return entry.type == JOINT_STATE and bool(entry.joints)


def values_of(entry: DofEntry, content: Content, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of the entry's DOFs in some messages, and which of them have them all.

    Args:
        entry: what to read; with columns one of which `has_columns` is true.
        content: of the topic.
        rows: indices of messages, int (n,).

    Returns:
        float64 (n, d), and bool (n,): False where a joint or field is missing.
    """
    if isinstance(content, PoseColumns):
        names = (*POSITION_FIELDS, *ORIENTATION_FIELDS)
        both = np.column_stack([content.positions[rows], content.orientations[rows]])
        return both[:, [names.index(field) for field in entry.fields]], np.ones(rows.size, bool)
    if isinstance(content, Columns):
        return _joint_values(entry, content, rows)
    values = np.full((rows.size, len(entry.names)), np.nan)
    found = np.ones(rows.size, bool)
    for k, row in enumerate(rows):
        try:
            values[k] = extract(entry, content[row])
        except MessageError:
            found[k] = False
    return values, found


def _joint_values(entry, content, rows) -> tuple[np.ndarray, np.ndarray]:
    values = np.full((content.stamps_ns.size, len(entry.joints)), np.nan)
    found = np.zeros(content.stamps_ns.size, bool)
    for part in content.parts:
        at = {name: k for k, name in enumerate(part.names)}
        columns = getattr(part, entry.quantity)
        wanted = [at.get(joint, columns.shape[1]) for joint in entry.joints]
        if max(wanted) < columns.shape[1]:
            values[part.rows] = columns[:, wanted]
            found[part.rows] = True
    return values[rows], found[rows]

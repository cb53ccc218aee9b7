# SPDX-License-Identifier: Apache-2.0
"""Values of degrees of freedom in messages: one by one, or in the columns of a whole topic."""

from collections.abc import Sequence
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from intent_recognition.bags import JOINT_STATE, POSE, Columns, JointColumns, PoseColumns
from intent_recognition.demonstrations.dofs import DofEntry
from intent_recognition.errors import MessageError, describe

POSITION_FIELDS = tuple(f"pose.position.{axis}" for axis in "xyz")
ORIENTATION_FIELDS = tuple(f"pose.orientation.{axis}" for axis in "xyzw")
POSE_FIELDS = (*POSITION_FIELDS, *ORIENTATION_FIELDS)
"""Numbers of a PoseStamped, in the order in which arrays of poses hold them."""
Content = Columns | Sequence[object]
"""Messages of a topic: as columns, or decoded one by one."""

pose_numbers = attrgetter(*POSE_FIELDS)
"""Position and orientation xyzw of a PoseStamped message, a tuple of 7."""


def pose_message(header: object, position: ArrayLike, orientation: ArrayLike) -> SimpleNamespace:
    """A pose with the attributes of a PoseStamped.

    Args:
        header: of the message.
        position: (3,) [m].
        orientation: (4,) xyzw.
    """
    pose = SimpleNamespace(
        position=SimpleNamespace(**dict(zip("xyz", np.asarray(position), strict=True))),
        orientation=SimpleNamespace(**dict(zip("xyzw", np.asarray(orientation), strict=True))),
    )
    return SimpleNamespace(header=header, pose=pose)


def extract(entry: DofEntry, message: Any) -> NDArray[np.float64]:
    """Values (d,) of the entry's DOFs in one decoded message.

    Args:
        entry: what to read.
        message: of rclpy or of a bag.

    Raises:
        MessageError: a joint or a field is missing, or is not a number. A JointState without
            the quantity asked for (an empty `velocity`, say) counts as a missing joint.
    """
    if not entry.joints:
        return np.array([_field_value(entry, message, field) for field in entry.fields], np.float64)
    indices, column = joint_column(entry, message)
    values = np.empty(len(entry.joints))
    for row, joint in enumerate(entry.joints):
        index = indices.get(joint)
        if index is None or index >= len(column):
            has = ", ".join(indices) if index is None else f"{len(column)} values for it"
            raise MessageError(
                describe(
                    f"{entry.topic} {entry.quantity}",
                    f"joint {joint}",
                    has or "no joints",
                    "Name the joints in the DOF file as the robot does.",
                )
            )
        values[row] = column[index]
    return values


def joint_column(entry: DofEntry, message: Any) -> tuple[dict[str, int], Sequence[float]]:
    """Index of each joint in a JointState, and the values of the entry's quantity.

    Raises:
        MessageError: the message is of another type.
    """
    try:
        indices = {name: k for k, name in enumerate(message.name)}
        return indices, getattr(message, entry.quantity)
    except AttributeError as error:
        raise MessageError(
            describe(entry.topic, entry.type, error, "Correct the type in the DOF file.")
        ) from error


def has_columns(entry: DofEntry) -> bool:
    """Whether the columns of its type hold all DOFs of the entry."""
    if entry.type == POSE:
        return set(entry.fields) <= set(POSE_FIELDS)
    return entry.type == JOINT_STATE and bool(entry.joints)


def values_of(
    entry: DofEntry, content: Content, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values of the entry's DOFs in some messages, and which messages have them all.

    Args:
        entry: what to read; with columns one of which `has_columns` is true.
        content: of the topic.
        rows: indices of messages, (n,).

    Returns:
        (n, d), and (n,): False where a joint or field is missing.
    """
    if isinstance(content, PoseColumns):
        poses = np.column_stack([content.positions[rows], content.orientations[rows]])
        columns = [POSE_FIELDS.index(field) for field in entry.fields]
        return poses[:, columns], np.ones(rows.size, bool)
    if isinstance(content, JointColumns):
        return _joint_values(entry, content, rows)
    values = np.full((rows.size, len(entry.names)), np.nan)
    found = np.ones(rows.size, bool)
    for k, row in enumerate(rows):
        try:
            values[k] = extract(entry, content[row])
        except MessageError:
            found[k] = False
    return values, found


def _joint_values(
    entry: DofEntry, content: JointColumns, rows: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    values = np.full((content.stamps_ns.size, len(entry.joints)), np.nan)
    found = np.zeros(content.stamps_ns.size, bool)
    for part in content.parts:
        indices = {name: k for k, name in enumerate(part.names)}
        columns = getattr(part, entry.quantity)
        wanted = [indices.get(joint, columns.shape[1]) for joint in entry.joints]
        if max(wanted) < columns.shape[1]:
            values[part.rows] = columns[:, wanted]
            found[part.rows] = True
    return values[rows], found[rows]


def _field_value(entry: DofEntry, message: Any, field: str) -> float:
    value = message
    try:
        for part in field.split("."):
            value = value[int(part)] if part.isdigit() else getattr(value, part)
        return float(value)
    except (AttributeError, IndexError, TypeError, ValueError) as error:
        raise MessageError(
            describe(
                f"{entry.topic}.{field}",
                f"a number in {entry.type}",
                error,
                "Correct the field path in the DOF file.",
            )
        ) from error

# SPDX-License-Identifier: Apache-2.0
"""Read the values of degrees of freedom from single messages or from a topic's columns."""

import re
from collections.abc import Sequence
from functools import lru_cache
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Flags, Floats, Integers
from intent_recognition.bags import (
    JOINT_STATE,
    NANOSECONDS,
    POSE,
    Columns,
    JointColumns,
    PoseColumns,
)
from intent_recognition.demonstrations.entry import DofEntry
from intent_recognition.demonstrations.paths import (
    STAMPED_ELEMENTS,
    ElementAbsentError,
    element_headers,
    follow,
    is_deleted,
    parse_path,
)
from intent_recognition.errors import DofError, MessageError
from intent_recognition.promp import Trajectory
from intent_recognition.signals import (
    POSE_FIELDS,
    from_tangent,
    quaternion_rates,
    right_jacobian,
    to_tangent,
)

POSITIONS = ("position", "translation")
"""Message attributes that hold a point in space [m]."""
Content = Columns | Sequence[object]
"""Messages of a topic, as columns or as decoded messages."""

pose_numbers = attrgetter(*POSE_FIELDS)
"""Getter of position and orientation xyzw from a PoseStamped message, as a tuple of 7."""


def pose_message(header: object, position: ArrayLike, orientation: ArrayLike) -> SimpleNamespace:
    """Object with the attributes of a PoseStamped, from position (3,) [m] and quaternion (4,)."""
    pose = SimpleNamespace(
        position=SimpleNamespace(**dict(zip("xyz", np.asarray(position), strict=True))),
        orientation=SimpleNamespace(**dict(zip("xyzw", np.asarray(orientation), strict=True))),
    )
    return SimpleNamespace(header=header, pose=pose)


def extract(entry: DofEntry, message: Any) -> Floats:
    """Values (d,) of the entry's DOFs in one decoded message.

    Raises:
        MessageError: a joint, a field or an array element is missing or not a number. An empty
            array of the quantity, such as `velocity`, also counts as a missing joint.
    """
    found = _read(entry, message)
    if found.missing is not None:
        raise found.missing
    return dofs_of(entry, found.values)


def extract_present(entry: DofEntry, message: Any) -> Floats:
    """Like `extract`, but missing joints and array elements are NaN unless all are missing."""
    found = _read(entry, message)
    if found.missing is not None and found.n_missing == len(found.values):
        raise found.missing
    return dofs_of(entry, found.values)


def dofs_of(entry: DofEntry, numbers: Floats) -> Floats:
    """Values (..., d) of the entry's DOFs from the numbers (..., m) of its fields or joints.

    An orientation is NaN where it was not measured or cannot be represented, see `to_tangent`.
    """
    if not entry.orientation:
        return numbers
    return to_tangent(numbers, reference_of(entry))


def numbers_of(entries: Sequence[DofEntry], trajectory: Trajectory) -> Trajectory:
    """Convert a trajectory of the entries' DOFs (T, d) to the numbers in messages (T, m).

    Orientations become quaternions with a continuous sign; other DOFs stay as they are. The `std`
    of a quaternion is that of the rotation about the body's x, y and z axes [rad], followed by zero
    for w. It ignores correlations between the components of the rotation vector.
    """
    if not any(entry.orientation for entry in entries):
        return trajectory
    edges = np.cumsum([len(entry.names) for entry in entries])[:-1]
    parts = zip(entries, *(np.split(of, edges, axis=1) for of in trajectory[1:]), strict=True)
    columns = [_quaternions(*part) if part[0].orientation else part[1:] for part in parts]
    return Trajectory(trajectory.times_s, *map(np.hstack, zip(*columns, strict=True)))


def _quaternions(
    entry: DofEntry, vectors: Floats, rates: Floats, std: Floats
) -> tuple[Floats, ...]:
    """Quaternions (T, 4), their rates (T, 4), and the std about the body's axes (T, 4)."""
    quaternions = from_tangent(vectors, reference_of(entry))
    about_axes = np.sqrt(np.einsum("tij,tj->ti", right_jacobian(vectors) ** 2, std**2))
    return (
        quaternions,
        quaternion_rates(quaternions, vectors, rates),
        np.hstack([about_axes, np.zeros((len(std), 1))]),
    )


def orientation_beside(entries: Sequence[DofEntry], group: int) -> int | None:
    """Index of the entry with the orientation of the body in entry `group`; None without one."""
    position = entries[group]
    columns = position_columns(position)
    if columns is None:
        return None
    body = position.fields[columns[0]].rpartition(".")[0].rpartition(".")[0]
    for k, entry in enumerate(entries):
        stem = entry.fields[0].rpartition(".")[0].rpartition(".")[0] if entry.orientation else None
        if entry.topic == position.topic and stem == body:
            return k
    return None


def reference_of(entry: DofEntry) -> tuple[float, ...]:
    """The reference of an orientation.

    Raises:
        DofError: the entry has no reference yet.
    """
    if not entry.reference:
        cure = "Call settle_orientations with the recordings, or give it in the DOF file."
        raise DofError.about(f"{entry.topic}: reference", "a unit quaternion", "none", cure)
    return entry.reference


def stamp_of(entry: DofEntry, message: Any, received_ns: int) -> int | None:
    """Time at which the entry's DOFs in a message (of rclpy or a bag) were measured [ns].

    Without a stamp in the message or its elements this is `received_ns`. None if the message has
    none of the entry's elements, or says that its body was not seen.
    """
    if is_deleted(message):
        return None
    if entry.type in STAMPED_ELEMENTS:
        stamps = [to_ns(header.stamp) for header in element_headers(message, entry.fields)]
        return (max(stamps) or received_ns) if stamps else None
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return received_ns if stamp is None else to_ns(stamp)


def to_ns(stamp: Any) -> int:
    """A message's time or duration [ns]."""
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


@lru_cache(maxsize=256)
def joint_indices(wanted: tuple[str, ...], names: tuple[str, ...]) -> list[int | None]:
    """Index of each joint among `names`, None unless it occurs once; the first match for a `*`."""
    found = {joint: names.index(joint) for joint in wanted if names.count(joint) == 1}
    return [_matching(joint, names) if "*" in joint else found.get(joint) for joint in wanted]


def position_columns(entry: DofEntry) -> list[int] | None:
    """Columns of x, y, z of the first complete position or translation among the fields."""
    for field in entry.fields:
        place = field.rpartition(".")[0]
        axes = [f"{place}.{axis}" for axis in "xyz"]
        if place.endswith(POSITIONS) and set(axes) <= set(entry.fields):
            return [entry.fields.index(axis) for axis in axes]
    return None


def has_columns(entry: DofEntry) -> bool:
    """Whether all DOFs of the entry can be read from columns of its message type."""
    if entry.type == POSE:
        return set(entry.fields) <= set(POSE_FIELDS)
    return entry.type == JOINT_STATE and bool(entry.joints)


def values_of(entry: DofEntry, content: Content, rows: Integers) -> tuple[Floats, Flags]:
    """Values (n, d) of the entry's DOFs in the messages `rows` (n,), and a mask of complete ones.

    Content given as columns requires `has_columns(entry)`.
    """
    if isinstance(content, PoseColumns):
        poses = np.column_stack([content.positions[rows], content.orientations[rows]])
        columns = [POSE_FIELDS.index(field) for field in entry.fields]
        return dofs_of(entry, poses[:, columns]), np.ones(rows.size, bool)
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


def _joint_values(entry: DofEntry, content: JointColumns, rows: Integers) -> tuple[Floats, Flags]:
    values = np.full((content.stamps_ns.size, len(entry.joints)), np.nan)
    found = np.zeros(content.stamps_ns.size, bool)
    for part in content.parts:
        columns = getattr(part, entry.quantity)
        wanted = [
            k
            for k in joint_indices(entry.joints, part.names)
            if k is not None and k < columns.shape[1]
        ]
        if len(wanted) == len(entry.joints):
            values[part.rows] = columns[:, wanted]
            found[part.rows] = True
    return values[rows], found[rows]


class _Reading(NamedTuple):
    """Values (d,), the number of values that the message lacks (NaN), and the error to raise."""

    values: Floats
    n_missing: int
    missing: MessageError | None


def _read(entry: DofEntry, message: Any) -> _Reading:
    return _read_joints(entry, message) if entry.joints else _read_fields(entry, message)


def _read_joints(entry: DofEntry, message: Any) -> _Reading:
    try:
        names, column = tuple(message.name), getattr(message, entry.quantity)
    except AttributeError as error:
        cure = "Correct the type in the DOF file."
        raise MessageError.about(entry.topic, entry.type, error, cure) from error
    values, n_missing, missing = np.full(len(entry.joints), np.nan), 0, None
    for row, index in enumerate(joint_indices(entry.joints, names)):
        if index is not None and index < len(column):
            values[row] = column[index]
            continue
        n_missing += 1
        if missing is None:
            has = ", ".join(names) if index is None else f"{len(column)} values for it"
            expected = f"joint {entry.joints[row]} once"
            cure = "Name the joints in the DOF file as the robot does."
            argument = f"{entry.topic} {entry.quantity}"
            missing = MessageError.about(argument, expected, has or "no joints", cure)
    return _Reading(values, n_missing, missing)


def _read_fields(entry: DofEntry, message: Any) -> _Reading:
    values, n_missing, missing = np.full(len(entry.fields), np.nan), 0, None
    for row, field in enumerate(entry.fields):
        try:
            values[row] = float(follow(message, parse_path(field)))
        except ElementAbsentError as error:
            n_missing += 1
            missing = missing or _not_a_number(entry, field, error)
        except (AttributeError, TypeError, ValueError) as error:
            raise _not_a_number(entry, field, error) from error
    return _Reading(values, n_missing, missing)


def _not_a_number(entry: DofEntry, field: str, error: Exception) -> MessageError:
    cure = "Correct the field path in the DOF file."
    return MessageError.about(f"{entry.topic}.{field}", f"a number in {entry.type}", error, cure)


def _matching(pattern: str, names: Sequence[str]) -> int | None:
    """Index of the first name that a pattern with `*` matches."""
    matches = re.compile(".*".join(map(re.escape, pattern.split("*")))).fullmatch
    return next((k for k, name in enumerate(names) if matches(name)), None)

# SPDX-License-Identifier: Apache-2.0
"""Recorded topics of a session, and of one interaction for the report, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypedDict, cast

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Floats, Integers


class ContactLog(NamedTuple):
    """True state of transfers (coworker/hand): stamps (H,), holders, forces (H, 3) [N]."""

    stamps_ns: Integers = np.empty(0, np.int64)
    holders: tuple[str, ...] = ()
    forces_n: Floats = np.empty((0, 3))


class TransferLog(NamedTuple):
    """Content of intent/transfer: stamps (T,), states, and values (T, 5) in its order."""

    stamps_ns: Integers = np.empty(0, np.int64)
    states: tuple[str, ...] = ()
    values: Floats = np.empty((0, 5))


NO_CONTACTS, NO_TRANSFERS = ContactLog(), TransferLog()


@dataclass(frozen=True)
class SessionLog:
    """Recorded topics of a session, in integer nanoseconds of its clock."""

    labels: tuple[str, ...]  # columns of the probabilities, `none` last
    # wrist_ns, wrist_m: raw tracker poses, (W,), (W, 3)
    wrist_ns: Integers
    wrist_m: Floats
    # tasks_ns, probabilities: stamps and posteriors of intent/tasks, (T,), (T, K + 1)
    tasks_ns: Integers
    probabilities: Floats
    # active_ns, active: stamps of changes of intent/active_task, and the new task
    active_ns: Integers
    active: tuple[str, ...]
    # joint_ns, joint_rad: measured joints, (M,), (M, n); fingers come last
    joint_ns: Integers
    joint_rad: Floats
    # holder of the object and the person's force on it, for handovers by force
    contacts: ContactLog = NO_CONTACTS
    transfers: TransferLog = NO_TRANSFERS  # the robot's estimate of the same


class Trace(TypedDict, total=False):
    """Arrays of one interaction; every key but `index` may be missing, None or empty.

    Times are seconds since onset.
    """

    index: int  # index of its record
    share: Floats  # (T,) share of the human's movement passed at each posterior
    labels: Sequence[str]  # labels of the K + 1 columns of the probabilities, `none` last
    probabilities: Floats  # (T, K + 1)
    decision_s: float
    end_s: float  # end of the human's movement
    person_s: Floats  # (H,)
    person_n: Floats  # (H,) magnitude of the person's true force on the object
    holders: Sequence[str]  # (H,) holder at these times
    transfer_s: Floats  # (F,)
    load_n: Floats  # (F,) load that the robot feels
    grip_n: Floats  # (F,) grip force of each finger
    load_share: Floats  # (F,) the person's share of the load


GROUPS = (
    ("share", "probabilities", "labels"),
    ("person_s", "person_n", "holders", "transfer_s", "load_n", "grip_n", "load_share"),
)
"""Keys that are meaningful only together; all of a group but the labels have equal length."""


def usable(trace: Trace) -> Trace:
    """A copy without empty entries and incomplete groups."""
    kept: dict[str, Any] = {}
    for key, value in trace.items():
        if value is not None and np.size(cast(ArrayLike, value)):
            kept[key] = value
    for group in GROUPS:
        if not all(key in kept for key in group):
            kept = {key: value for key, value in kept.items() if key not in group}
    return cast(Trace, kept)

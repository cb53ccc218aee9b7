# SPDX-License-Identifier: Apache-2.0
"""What was on the topics of a session, as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers


class ContactLog(NamedTuple):
    """Ground truth of transfers (coworker/hand): stamps (H,), holders, forces (H, 3) [N]."""

    stamps_ns: Integers = np.empty(0, np.int64)
    holders: tuple[str, ...] = ()
    forces_n: Floats = np.empty((0, 3))


class TransferLog(NamedTuple):
    """What was on intent/transfer: stamps (T,), states, and values (T, 5) as it names them."""

    stamps_ns: Integers = np.empty(0, np.int64)
    states: tuple[str, ...] = ()
    values: Floats = np.empty((0, 5))


NO_CONTACTS, NO_TRANSFERS = ContactLog(), TransferLog()


@dataclass(frozen=True)
class SessionLog:
    """What was on the topics of a session, in integer nanoseconds of its clock.

    Attributes:
        labels: columns of the probabilities, `none` last.
        wrist_ns, wrist_m: raw tracker poses, (W,), (W, 3).
        tasks_ns, probabilities: stamps and posteriors of intent/tasks, (T,), (T, K + 1).
        active_ns, active: when intent/active_task changed, and to what.
        joint_ns, joint_rad: measured joints, (M,), (M, n); fingers come last.
        predictions: (arrival ns, onset ns, task, times_s (L,), mean (L, q), std (L, q)) of
            intent/robot_trajectory; of joints [rad], or of the hand [m].
        paths: (stamp ns, wrist (V, 3)) of intent/human_path.
        contacts: who holds the object, and the person's force on it, where it is handed over.
        transfers: what the robot feels of it.
    """

    labels: tuple[str, ...]
    wrist_ns: Integers
    wrist_m: Floats
    tasks_ns: Integers
    probabilities: Floats
    active_ns: Integers
    active: tuple[str, ...]
    joint_ns: Integers
    joint_rad: Floats
    predictions: Sequence[tuple]
    paths: Sequence[tuple]
    contacts: ContactLog = NO_CONTACTS
    transfers: TransferLog = NO_TRANSFERS

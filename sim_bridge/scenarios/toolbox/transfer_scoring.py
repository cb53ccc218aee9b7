# SPDX-License-Identifier: Apache-2.0
"""Score whether an interaction's object changed hands, from the ground truth of the physics."""

from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Integers
from intent_recognition.evaluation import ContactLog, SessionLog, Trace
from sim_bridge.scenarios.toolbox.transfers import Holder

HANDS = (Holder.ROBOT.value, Holder.PERSON.value)


class TransferScore(NamedTuple):
    """Whether an object changed hands, when (None if never), and the person's largest force [N]."""

    handed_over: bool
    at_ns: int | None
    largest_force_n: float


def score_transfer(contacts: ContactLog, from_ns: int, until_ns: int) -> TransferScore | None:
    """Score the interaction between two stamps; None if there are no contacts.

    An object is handed over if one of the two held it alone, then the other one at the end, and it
    was not dropped.
    """
    rows = slice(*np.searchsorted(contacts.stamps_ns, [from_ns, until_ns]))
    stamps, holders = contacts.stamps_ns[rows], contacts.holders[rows]
    if not len(stamps):
        return None
    force_n = float(np.linalg.norm(contacts.forces_n[rows], axis=1).max())
    alone = [(k, h) for k, h in enumerate(holders) if h in HANDS]
    if not alone or alone[0][1] == alone[-1][1] or _dropped(stamps, holders):
        return TransferScore(False, None, force_n)
    last = alone[-1][1]
    k = 1 + max(row for row, holder in alone if holder != last)
    at_ns = next(int(stamps[row]) for row, holder in alone if row >= k)
    return TransferScore(True, at_ns, force_n)


def _dropped(stamps: Integers, holders: tuple[str, ...]) -> bool:
    begun: int | None = None
    for stamp, holder in zip(stamps.tolist(), holders, strict=True):
        if holder != Holder.NOBODY.value:
            begun = None
            continue
        begun = stamp if begun is None else begun
        if stamp - begun >= 50_000_000:  # a bounce of the pads is shorter
            return True
    return False


def transfer_trace(
    log: SessionLog, onset_ns: int, end_ns: int, until_ns: int, score: TransferScore
) -> Trace:
    """Forces from the end of the movement until a second after the transfer, or until the end."""
    stop_ns = until_ns if score.at_ns is None else score.at_ns + 1_000_000_000
    felt = slice(*np.searchsorted(log.transfers.stamps_ns, [end_ns, stop_ns]))
    true = slice(*np.searchsorted(log.contacts.stamps_ns, [end_ns, stop_ns]))
    values = log.transfers.values[felt]
    return {
        "person_s": 1e-9 * (log.contacts.stamps_ns[true] - onset_ns).astype(np.float64),
        "person_n": np.linalg.norm(log.contacts.forces_n[true], axis=1),
        "holders": log.contacts.holders[true],
        "transfer_s": 1e-9 * (log.transfers.stamps_ns[felt] - onset_ns).astype(np.float64),
        "load_share": values[:, 0],
        "load_n": values[:, 1],
        "grip_n": values[:, 3],
    }

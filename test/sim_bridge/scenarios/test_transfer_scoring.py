# SPDX-License-Identifier: Apache-2.0
"""Who held the object last says whether it was handed over."""

import numpy as np
import pytest

from intent_recognition.evaluation import ContactLog
from sim_bridge.scenarios.toolbox.transfer_scoring import score_transfer

STEP_NS = 10_000_000


def contacts(*held: tuple[str, float], force_n=5.0) -> ContactLog:
    """Holders, each for a time [s]."""
    holders = [holder for holder, length_s in held for _ in range(round(length_s * 1e9 / STEP_NS))]
    stamps = STEP_NS * np.arange(len(holders), dtype=np.int64)
    return ContactLog(stamps, tuple(holders), np.full((len(holders), 3), force_n / np.sqrt(3.0)))


@pytest.mark.parametrize("gives", ["robot", "person"])
def test_what_the_other_one_holds_at_the_end_was_handed_over(gives):
    takes = {"robot": "person", "person": "robot"}[gives]
    log = contacts(("stand", 0.5), (gives, 1.0), ("both", 0.3), (takes, 1.0), ("", 0.5))
    score = score_transfer(log, 0, 10**10)
    assert score.handed_over
    assert score.at_ns == pytest.approx(1.8e9)
    assert score.largest_force_n == pytest.approx(5.0)


@pytest.mark.parametrize(
    "held",
    [
        [("robot", 1.0), ("both", 1.0), ("robot", 1.0)],  # nobody took it in the end
        [("robot", 1.0), ("both", 1.0)],
        [("robot", 1.0), ("both", 0.2), ("nobody", 0.5)],
        [("robot", 1.0), ("nobody", 0.1), ("person", 1.0)],  # caught
        [("stand", 2.0)],
    ],
)
def test_what_was_kept_or_dropped_was_not(held):
    score = score_transfer(contacts(*held), 0, 10**10)
    assert not score.handed_over and score.at_ns is None


def test_what_is_held_for_good_within_the_interaction_counts():
    bounce = [("person", 0.1), ("both", 0.1)]
    held = contacts(("robot", 1.0), ("nobody", 0.03), *bounce, ("robot", 0.2), ("person", 1.0))
    score = score_transfer(held, 0, 10**10)
    assert score.handed_over and score.at_ns == pytest.approx(1.43e9)
    log = contacts(("robot", 1.0), ("person", 1.0), ("person", 1.0), ("robot", 1.0))
    assert not score_transfer(log, 0, 10**10).handed_over
    assert score_transfer(log, 0, 2 * 10**9).handed_over
    assert score_transfer(ContactLog(), 0, 10**10) is None

# SPDX-License-Identifier: Apache-2.0
"""The monitor over a movement decides as the nodes do, and says which gate kept one back."""

from types import SimpleNamespace

import numpy as np
import pytest

from intent_recognition.evaluation.unknown_movements import DecisionMonitor, compare
from intent_recognition.filtering.grid import PriorGrid
from intent_recognition.recognition.decision import DecisionSettings


@pytest.mark.parametrize(("none_evidence", "activated"), [(-3.0, "a"), (2.0, "")])
def test_what_speaks_for_none_activates_nothing(none_evidence, activated):
    found = followed([0.9989, 0.0001, 0.001], [1.0, -5.0, none_evidence], [0.01] * 10)
    assert found.above_threshold
    assert found.activated == activated


def test_a_movement_is_acted_on_where_the_learned_risk_allows_it():
    for threshold, activated in ((0.6, "a"), (0.8, "")):
        settings = DecisionSettings(risk=SimpleNamespace(threshold=threshold), min_evidence=0.0)
        found = followed([0.7, 0.25, 0.05], [0.0] * 3, [0.01] * 10, settings)
        assert found.activated == activated


def followed(prior, log_evidence, end_std, settings=DecisionSettings()):  # noqa: B008
    """What a monitor says of a movement of a, whose predicted end is so uncertain in turn."""
    run = SimpleNamespace(
        grid=PriorGrid(1, np.ones(3), np.log(prior)),
        log_evidence=np.array(log_evidence),
        end_std=lambda task: {"rad": end_std.pop(0)},
    )
    monitor = DecisionMonitor(SimpleNamespace(labels=("a", "b")), settings)
    for k in range(8):
        monitor.observe(run, 0.1 * k)
    return monitor.outcome("a")


def test_what_is_recognised_and_held_back_by_its_uncertain_end_is_told_apart():
    sure, unsure, late = (
        followed([0.445, 0.445, 0.11], [5.0, -5.0, -3.0], end_std)
        for end_std in ([0.3, 0.2], [0.9, 0.8, 0.7, 0.6, 0.5], [0.4, 0.4, 0.3, 0.1])
    )
    assert (sure.recognised, sure.activated, sure.held_back, sure.end_std) == ("a", "a", False, 0.2)
    assert (unsure.recognised, unsure.activated, unsure.held_back) == ("a", "", True)
    assert late.activated == "a" and late.end_std == 0.1
    content = compare([sure, unsure, late, late], [unsure])
    assert content["recognised_known"] == 1.0
    assert content["held_back_known"] == 0.25 and content["activated_known"] == 0.75
    assert content["held_back_unknown"] == 1.0 and content["activated_unknown"] == 0.0
    assert content["end_std_known"]["0.5"] == pytest.approx(0.15)
    assert content["left_out"]["a"]["recognised"] == 1.0
    assert compare([], [])["end_std_known"] is None

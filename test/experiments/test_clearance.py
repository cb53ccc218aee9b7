# SPDX-License-Identifier: Apache-2.0
"""Boxes in the arm's way, on a subset: physics find no contact of the guarded arm."""

import json

import numpy as np
import pytest

from experiments.clearance import experiment, study
from experiments.execution import Executed
from experiments.reaches import REST_S
from experiments.settings import Settings
from intent_recognition.activation import Mode
from intent_recognition.report.html import ReportPage, Section, render


@pytest.mark.slow
def test_no_box_is_touched_that_would_be(monkeypatch):
    drawn, numbers = study.draw_boxes, iter((1, 2, 1))  # the second would be as the first

    def draw(*args):
        return [drawn(*args) for _ in range(next(numbers))][-1]

    monkeypatch.setattr(study, "draw_boxes", draw)
    monkeypatch.setattr(study, "N_QUICK", (1, 3))
    outcome = experiment.run(Settings(quick=True))
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    runs = numbers["runs"]
    assert {one["outcome"] for one in runs} == {"as before", "bent", "replanned"}
    assert numbers["refused_without_replanning"]
    assert any(one["unguarded_touches"] for one in runs)
    assert not any(one["guarded_touches"] for one in runs) and numbers["self_contacts"] == 0
    for one in runs:
        assert bool(one["refusals"]) >= (one["outcome"] == "refused")
        if one["without_boxes_nearest_m"] > 0.0 and one["guarded_nearest_m"] > 0.0:
            assert not one["unguarded_touches"]
        if one["without_boxes_nearest_m"] > 0.06:
            assert one["outcome"] == "as before" and one["lost_s"] == 0.0
    assert "Clear of boxes" in render(
        ReportPage("t", "s", (Section("Clear of boxes", outcome.blocks),))
    )


def test_an_arrival_is_when_the_hand_stays_near_its_rest():
    hand = np.zeros((150, 3))
    hand[:100, 0] = np.linspace(1.0, 0.0, 100)
    hand[140:, 0] = 0.5  # on the way home
    modes = [Mode.EXECUTING] * 140 + [Mode.HOMING] * 10
    done = Executed(hand, (), hand, tuple(modes), (), None, {}, (), 0, ("", ""))
    k = round((study.arrival_s(done) + REST_S) / 0.01)
    assert np.linalg.norm(hand[k] - hand[139]) <= 0.01 < np.linalg.norm(hand[k - 1] - hand[139])
    still = done._replace(modes=(Mode.IDLE,) * 150)
    assert study.arrival_s(still) == np.inf

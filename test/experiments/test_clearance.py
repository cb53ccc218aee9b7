# SPDX-License-Identifier: Apache-2.0
"""Boxes in the arm's way, on a subset: PyBullet finds no contact of the guarded arm."""

import json

import numpy as np
import pytest

from intent_recognition.experiments.clearance import experiment, study
from intent_recognition.experiments.settings import Settings
from intent_recognition.report.html import ReportPage, Section, render


@pytest.mark.slow
def test_no_box_is_touched_that_would_be(monkeypatch):
    monkeypatch.setattr(study, "N_QUICK", (2, 5))
    outcome = experiment.run(Settings(quick=True))
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    runs = numbers["runs"]
    assert len(runs) == 10
    assert any(one["unguarded_nearest_m"] <= 0.0 for one in runs)
    assert all(one["guarded_nearest_m"] > 0.0 for one in runs) and numbers["self_contacts"] == 0
    for one in runs:
        assert bool(one["refusals"]) >= (one["outcome"] == "refused")
        if one["unguarded_nearest_m"] > 0.06:
            assert one["outcome"] == "as before" and one["lost_s"] == 0.0
    assert "Clear of boxes" in render(
        ReportPage("t", "s", (Section("Clear of boxes", outcome.blocks),))
    )


def test_an_arrival_is_when_the_hand_stays_near_its_rest():
    still, away = np.zeros((50, 7)), np.zeros((50, 7))
    away[:, 1] = np.linspace(1.0, 0.0, 50)
    way = np.vstack([away, still])
    arrived = study._arrival_s(way, len(way))
    hand = study.hand_position(way)
    k = round(arrived / 0.01)
    assert np.linalg.norm(hand[k] - hand[-1]) <= 0.01 < np.linalg.norm(hand[k - 1] - hand[-1])
    assert study._arrival_s(way, 0) == np.inf

# SPDX-License-Identifier: Apache-2.0
"""The shipped demonstrations beside the pole, and the experiment on a subset."""

import numpy as np
import pytest

from experiments.pole import experiment as pole
from experiments.pole.geometry import fingertip, way_of
from experiments.pole.study import draw
from experiments.settings import Settings
from intent_recognition.demonstrations import read_demonstrations
from intent_recognition.demonstrations.dofs import load_dofs
from intent_recognition.report.html import ReportPage, Section, render
from intent_recognition.share import share_path

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


@pytest.fixture(scope="module")
def outcome():
    return pole.run(Settings(quick=True))


def test_shipped_demonstrations_are_unlabelled_and_go_where_their_metadata_say():
    demonstrations, rejections = read_demonstrations(
        share_path("bags/pole"), load_dofs(share_path("config/dofs_pole.yaml"))
    )
    assert len(demonstrations) == 28 and not rejections
    ways = [d.metadata["way"] for d in demonstrations]
    assert ways.count("left") == ways.count("right") == 14
    for d, way in zip(demonstrations, ways, strict=True):
        assert d.task is None
        q = d.controlled[0].values
        assert way_of(fingertip(q)) == way
        assert np.abs(np.diff(q, axis=0)).max() < 0.05  # no branch is changed
        assert way in d.metadata["reachable"].split()
        assert float(d.metadata["clearance_m"]) > 0.01


def test_one_gaussian_hits_the_pole_and_the_chosen_mixture_does_not(outcome):
    single, mixture, _, end = outcome.numbers["executed"]
    assert outcome.numbers["chosen"] > 1
    assert single["hits"] > 0
    assert mixture["hits"] == end["hits"] == 0
    assert outcome.numbers["purity"] == 1.0


def test_the_outcome_is_a_report(outcome):
    assert all(finding.holds is not False for finding in outcome.findings)
    page = render(ReportPage(outcome.title, outcome.source, (Section("x", outcome.blocks),)))
    assert "http://" not in page.replace("http://www.w3.org", "")
    n = len(outcome.numbers["components"])
    assert np.shape(outcome.numbers["tip_rms_m"]) == (n, 28)


def test_recordings_drawn_again_are_told_by_the_same_numbers(outcome):
    settings = Settings(quick=True)
    drawn = draw(settings.recordings("pole"), settings)
    (shipped,) = outcome.numbers["draws"]
    if outcome.numbers["chosen"] == drawn["components"]:  # a quick run tries fewer
        assert {"seed": 1, **drawn} == pytest.approx(shipped)
    assert drawn["path"] < drawn["path, single"]

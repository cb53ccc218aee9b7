# SPDX-License-Identifier: Apache-2.0
"""The experiment of the moved box on a subset."""

import json

import numpy as np
import pytest

from experiments.context import study
from experiments.context.experiment import run
from experiments.context.study import (
    CONDITIONS,
    KNOWN,
    LATER,
    NEVER,
    SHARES,
    TURNS_AT,
    WITHOUT,
    hand_over,
    paths,
)
from experiments.settings import Settings


def test_until_the_wrist_turns_it_does_not_tell_where_the_box_stands():
    share, still = np.linspace(0.0, 1.0, 101), np.zeros((2, 3))
    (wrist, hand), (other, _) = (
        paths("fetch", share, np.array(box), 0.2, still) for box in ((0.4, 0.2), (0.7, -0.2))
    )
    together = share <= TURNS_AT
    np.testing.assert_array_equal(wrist[together], other[together])
    assert np.linalg.norm(wrist[-1] - other[-1]) == pytest.approx(0.5)
    apart = hand[-1] - [0.4, 0.2, 0.1]
    expected = [0.05 * np.cos(0.2) - 0.15 * np.sin(0.2), 0.05 * np.sin(0.2) + 0.15 * np.cos(0.2)]
    np.testing.assert_allclose(apart, [*expected, 0.05], atol=1e-12)


def test_a_recording_has_the_box_as_its_context():
    one = hand_over("insert", np.random.default_rng(1))
    assert [signal.unit for signal in one.context] == ["m", "rad"]
    assert one.context_values.shape == (3,)
    assert one.start_ns == round(study.REST_S * 1e9)


@pytest.mark.slow
@pytest.mark.usefixtures("usually_tried")
def test_who_knows_the_box_predicts_and_acts_before_the_wrist_turns_to_it():
    outcome = run(Settings(quick=True))
    numbers = json.loads(json.dumps(dict(outcome.numbers)))
    error = {name: np.mean(numbers["end_error_m"][name], axis=0) for name in CONDITIONS}
    early, late = SHARES.index(0.1), SHARES.index(0.3)
    assert error[KNOWN][late] < 0.4 * error[WITHOUT][late]
    assert error[LATER][early] == error[NEVER][early]
    assert error[LATER][late] == error[KNOWN][late]
    decided = numbers["decided_share"]
    assert max(decided[KNOWN]) < TURNS_AT < min(share or 1.0 for share in decided[WITHOUT])
    assert len(outcome.blocks) == 1 and all(one.remark for one in outcome.findings)

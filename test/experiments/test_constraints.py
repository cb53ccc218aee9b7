# SPDX-License-Identifier: Apache-2.0
"""The task constraints' experiment on the shipped trials, and its ROC curves."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.constraints.experiment import run
from experiments.constraints.features import LABEL, STANDARD, ConstraintSamples
from experiments.constraints.roc import on_grid, roc_curve
from experiments.constraints.study import NOVEL, SAME, score
from experiments.settings import Settings

pytestmark = pytest.mark.slow  # the whole experiment runs first, in its quick form


def test_no_ball_went_through_a_wall_and_warped_features_carry_over():
    numbers = run(Settings(quick=True)).numbers
    for count in numbers["n_trials"].values():
        assert count >= 1000
        assert count % 10 == 0
    assert numbers["through_wall"] == {"pouring": 0, "filling": 0}
    for areas in numbers["areas"].values():
        assert areas[LABEL][NOVEL] > areas[STANDARD][NOVEL] + 0.05
    assert numbers["areas"]["pouring"][LABEL][NOVEL] > 0.95


def samples(shift):
    """Two objects whose labels turn at zero and at `shift`."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1.0, 1.0, (400, 1))
    objects = np.repeat([0, 1], 200)
    return ConstraintSamples(x, (x[:, 0] > shift * objects).astype(float), objects)


def test_scores_of_one_rule_and_of_two():
    found = score(samples(0.0), 3, np.random.default_rng(1))
    assert found[NOVEL].area == found[SAME].area == 1.0
    assert found[NOVEL].curves.shape == (6, 201)
    assert found[NOVEL].trained_on.tolist() == [0, 0, 0, 1, 1, 1]
    again = score(samples(0.0), 3, np.random.default_rng(1))
    np.testing.assert_array_equal(again[SAME].curves, found[SAME].curves)


SAMPLES = st.lists(st.tuples(st.integers(-3, 3), st.booleans()), min_size=2, max_size=40).filter(
    lambda rows: len({label for _, label in rows}) == 2
)


@given(SAMPLES)
def test_area_is_how_often_a_positive_scores_higher(rows):
    scores, labels = (np.array(column) for column in zip(*rows, strict=True))
    pairs = scores[labels][:, None] - scores[~labels][None]
    expected = np.mean((pairs > 0) + 0.5 * (pairs == 0))
    curve = roc_curve(scores, labels)
    assert curve.area == pytest.approx(expected)
    for rates in (curve.false_positive, curve.true_positive, on_grid(curve)):
        assert np.all(np.diff(rates) >= 0.0)
        assert rates[-1] == 1.0
    flipped = roc_curve(-scores, labels)
    assert flipped.area == pytest.approx(1.0 - curve.area)

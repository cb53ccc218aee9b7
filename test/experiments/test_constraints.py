# SPDX-License-Identifier: Apache-2.0
"""Task constraints: features of any size, trials that go on where they stopped, the experiment."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.constraints.experiment import run
from experiments.constraints.features import LABEL, STANDARD
from experiments.constraints.roc import on_grid, roc_curve
from experiments.constraints.spilling import (
    NO_REFERENCES,
    RIDGE,
    FillingConstraint,
    FillingState,
    PouringConstraint,
    PouringState,
    spill_risk,
)
from experiments.constraints.study import NOVEL
from experiments.settings import Settings
from intent_recognition.errors import TrainingError
from intent_recognition.warping import References, fit_logistic

CUP = References(0.04, 4e-4, 0.1, 0.8)
SECOND = References(0.06, 5e-4, 0.06, 0.4)
SIZES = st.floats(0.2, 5.0)


def pouring_states(count=200, seed=0):
    rng = np.random.default_rng(seed)
    return PouringState(4e-4 * rng.random(count), 1.6 * rng.random(count))


def filling_states(count=200, seed=0):
    rng = np.random.default_rng(seed)
    offset = rng.uniform((-0.1, -0.1, 0.0), (0.1, 0.1, 0.1), (count, 3))
    return FillingState(3e-5, 4e-4 * rng.random(count), 2.1, offset)


def without_throw(features, filled):
    return FillingConstraint(fit_logistic(features, filled, ridge=RIDGE))


def scaled(references, size):
    return References(
        size * references.opening_radius_m,
        size**3 * references.volume_m3,
        size * references.height_m,
        references.tilt_rad,
    )


@given(SIZES)
def test_a_larger_scene_has_the_same_features(size):
    state = pouring_states()
    larger = PouringState(size**3 * state.fluid_m3, state.tilt_rad)
    np.testing.assert_allclose(
        PouringConstraint.features(larger, scaled(CUP, size)),
        PouringConstraint.features(state, CUP),
    )
    fill = filling_states()
    larger = FillingState(
        size**3 * fill.fluid_m3, size**3 * fill.second_fluid_m3, fill.tilt_rad, size * fill.offset_m
    )
    np.testing.assert_allclose(
        FillingConstraint.features(larger, scaled(CUP, size), scaled(SECOND, size), throw=0.7),
        FillingConstraint.features(fill, CUP, SECOND, throw=0.7),
    )


def test_without_references_variables_stay_as_they_are_and_single_numbers_are_repeated():
    state = pouring_states()
    found = PouringConstraint.features(state, NO_REFERENCES)
    np.testing.assert_array_equal(found, np.column_stack([state.tilt_rad, state.fluid_m3]))
    fill = filling_states()
    found = FillingConstraint.features(fill, NO_REFERENCES, NO_REFERENCES)
    np.testing.assert_array_equal(found[:, [0, 2, 4]], fill.offset_m)
    found = PouringConstraint.features(PouringState(2e-4, np.array([0.4, 0.8])), CUP)
    np.testing.assert_allclose(found, [[0.5, 0.5], [1.0, 0.5]])


def test_what_one_cup_taught_holds_for_another():
    def pours(state, cup):
        share = state.fluid_m3 / cup.volume_m3
        return (state.tilt_rad / cup.tilt_rad > 1.6 - share).astype(float)

    seen, other = pouring_states(), pouring_states(seed=1)
    learned = PouringConstraint.learn(PouringConstraint.features(seen, CUP), pours(seen, CUP))
    bowl = References(0.08, 3e-4, 0.05, 0.3)
    found = learned.probability(other, bowl) > 0.5
    assert np.mean(found == pours(other, bowl).astype(bool)) > 0.95


def test_a_throw_moves_the_offset_along_to_where_it_lands():
    states = filling_states(100)
    plain = FillingConstraint.features(states, CUP, SECOND)
    unit = FillingConstraint.unit_throw(states, CUP, SECOND)
    np.testing.assert_allclose(unit**2, 0.1 * states.offset_m[:, 2] / 0.06**2)
    thrown = FillingConstraint.features(states, CUP, SECOND, throw=0.6)
    np.testing.assert_allclose(thrown[:, 0], plain[:, 0] + 0.6 * unit)
    np.testing.assert_allclose(thrown[:, 1], thrown[:, 0] ** 2)
    np.testing.assert_array_equal(thrown[:, 2:], plain[:, 2:])


@pytest.mark.parametrize("true_throw", [0.3, 0.75, 1.2])
def test_the_throw_is_learned_and_holds_for_another_cup(true_throw):

    def filled(states, cup):
        along = FillingConstraint.features(states, cup, SECOND, throw=true_throw)[:, :4:2]
        return (np.linalg.norm(along, axis=1) < 1.0).astype(float)

    seen, other = filling_states(400), filling_states(400, seed=1)
    features = FillingConstraint.features(seen, CUP, SECOND)
    unit = FillingConstraint.unit_throw(seen, CUP, SECOND)
    learned = FillingConstraint.learn_throw(features, unit, filled(seen, CUP))
    assert abs(learned.throw - true_throw) < 0.16
    bowl = CUP._replace(height_m=0.04)
    found = learned.probability(other, bowl, SECOND) > 0.5
    plain = without_throw(features, filled(seen, CUP))
    without = plain.probability(other, bowl, SECOND) > 0.5
    truth = filled(other, bowl).astype(bool)
    assert np.mean(found == truth) > max(0.93, np.mean(without == truth) + 0.02)


def test_tilting_on_the_way_is_risky_and_over_the_opening_is_not():
    states = filling_states(400)
    inside = np.linalg.norm(states.offset_m[:, :2], axis=1) < SECOND.opening_radius_m
    filling = without_throw(FillingConstraint.features(states, CUP, SECOND), inside.astype(float))
    tilted = pouring_states(400)
    features = PouringConstraint.features(tilted, CUP)
    pouring = PouringConstraint.learn(features, (features[:, 0] > 1.0).astype(float))
    places = np.array([[-0.15, 0.0, 0.05], [-0.15, 0.0, 0.05], [0.0, 0.0, 0.05]])
    path = FillingState(2e-4, 1e-4, np.array([0.3, 1.5, 1.5]), places)
    risk = spill_risk(pouring, filling, path, CUP, SECOND)
    assert risk[0] < 0.1
    assert risk[1] > 0.9
    assert risk[2] < 0.1


def test_refuses_what_cannot_be_learned_from():
    features = PouringConstraint.features(pouring_states(), CUP)
    with pytest.raises(TrainingError):
        PouringConstraint.learn(features, np.ones(len(features)))


@pytest.mark.slow
def test_no_ball_went_through_a_wall_and_warped_features_carry_over():
    numbers = run(Settings(quick=True)).numbers
    for count in numbers["n_trials"].values():
        assert count >= 1000
        assert count % 10 == 0
    assert numbers["through_wall"] == {"pouring": 0, "filling": 0}
    for areas in numbers["areas"].values():
        assert areas[LABEL][NOVEL] > areas[STANDARD][NOVEL] + 0.05
    assert numbers["areas"]["pouring"][LABEL][NOVEL] > 0.95


SAMPLES = st.lists(st.tuples(st.integers(-3, 3), st.booleans()), min_size=2, max_size=40).filter(
    lambda rows: len({label for _, label in rows}) == 2
)


@pytest.mark.slow
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

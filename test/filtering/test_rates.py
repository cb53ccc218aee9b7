# SPDX-License-Identifier: Apache-2.0
"""What passes to newborn hypotheses in a time, and how long the course of a reach afresh moves."""

import numpy as np
import pytest
from simulation import minimum_jerk, nearly_known

from intent_recognition.filtering import rates
from intent_recognition.filtering.rates import birth_shares, moving_parts, switch_threshold
from intent_recognition.promp import STEADY


def test_what_passes_on_is_what_the_rates_say(rng):
    total = rng.normal(size=5)
    passed = np.exp(birth_shares(total, np.full(4, -np.log(4.0)), 0.02, none_margin=1.5))
    known = np.exp(total[:-1]).sum()
    rate = rates.SWITCH_RATE + rates.DETOUR_RATE
    turning = passed[rates.TURN, :4] - 0.02 * rates.DETOUR_RATE * np.exp(total[:-1])
    assert np.isclose(passed[rates.TURN, :4].sum(), 0.02 * rate * known)
    assert np.isclose(passed[rates.TURN, 4], 0.02 * rates.NONE_RATE * np.exp(-1.5) * known)
    delayed, afresh = passed[rates.DELAY], passed[rates.AFRESH]
    np.testing.assert_allclose(delayed[:4], 0.02 * rates.DELAY_RATE * np.exp(total[:-1]))
    np.testing.assert_allclose(afresh[:4], rates.REACH_RATE / rates.SWITCH_RATE * turning)
    assert delayed[4] == afresh[4] == 0.0


def test_nobody_turns_to_an_impossible_task_and_with_a_margin_turns_are_rarer(rng):
    total, log_prior = rng.normal(size=4), np.log([0.2, 0.3, 0.5])
    detours = np.exp(total[:-1]) * rates.DETOUR_RATE * 0.02
    turning = np.exp(birth_shares(total, log_prior, 0.02))[rates.TURN, :3] - detours
    rarer = (
        np.exp(birth_shares(total, log_prior, 0.02, switch_margin=2.0))[rates.TURN, :3] - detours
    )
    np.testing.assert_allclose(rarer, np.exp(-2.0) * turning)
    with np.errstate(divide="ignore"):
        log_prior = np.log([0.5, 0.5, 0.0])
    passed = np.exp(birth_shares(np.array([0.0, 0.0, -np.inf, 0.0]), log_prior, 0.1))
    assert passed[rates.TURN, 2] == 0.0 and passed[rates.TURN, 0] > 0.0
    alone = np.exp(birth_shares(np.zeros(2), np.zeros(1), 0.1))
    assert np.isclose(alone[rates.TURN, 0], 0.1 * rates.DETOUR_RATE)


def test_a_mind_that_stays_is_taken_for_changed_in_at_most_the_stated_share(rng):
    """Beside simulated odds: in each step some turn, and all are told apart by normal evidence."""
    steps, evidence, share = 100, 0.5, 0.05
    rate = rates.SWITCH_RATE + rates.REACH_RATE * rates.REACH_UNTIL
    odds, largest = np.zeros(4000), np.zeros(4000)
    for _ in range(steps):
        for_it = evidence * rng.normal(size=len(odds)) - 0.5 * evidence**2
        odds = (odds + rate / steps) * np.exp(for_it)
        largest = np.maximum(largest, odds)
    taken = np.mean(largest / (1.0 + largest) >= switch_threshold(share))
    assert 0.2 * share < taken <= share


@pytest.mark.parametrize("part", [1.0, 0.75, 0.5])
@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_course_moves_until_it_holds_its_end(part, scale):
    done = minimum_jerk(np.clip(np.linspace(0.0, 1.0, 500) / part, 0.0, 1.0))
    shape = done[:, None] * np.array([0.3, -0.1 * scale, 0.5])
    library = nearly_known(shape, 0.001, STEADY)
    assert moving_parts(library, np.array([1.0, scale])) == pytest.approx([part], abs=0.02)

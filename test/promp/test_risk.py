# SPDX-License-Identifier: Apache-2.0
"""The share of wrong actions is bounded, whatever the odds are distributed like."""

import numpy as np
import pytest
from scipy.special import expit

from intent_recognition.promp import UNNAMED, LeftOutOdds, conformal_bound, risk_of


def of_nobody(odds):
    return LeftOutOdds(tuple(odds), ("",) * len(odds))


def test_without_groups_the_threshold_is_the_split_conformal_quantile(rng):
    """The highest of 19, the second of 39 (Vovk et al. 2005)."""
    for n, rank in ((19, 19), (39, 38), (59, 57)):
        odds = rng.permutation(np.linspace(1.0, 3.0, n))
        risk = risk_of(of_nobody(odds), 0.05)
        assert risk.threshold == pytest.approx(expit(np.sort(odds)[rank - 1]))
        assert (risk.bound, risk.n_groups, risk.grouped) == (0.05, n, False)
    assert risk_of(of_nobody(np.linspace(-9.0, -8.0, 40)), 0.05).threshold == 0.6


def test_one_more_interaction_is_wrong_in_at_most_the_stated_share(rng):
    """Of a new person, however different people are and however many interactions each has."""
    wrong = []
    for _ in range(1000):
        counts = rng.integers(1, 5, size=25)
        people = rng.standard_normal(26)
        odds = np.concatenate(
            [p + 0.3 * rng.standard_normal(n) for p, n in zip(people, counts, strict=False)]
        )
        groups = tuple(f"p{k}" for k in np.repeat(np.arange(25), counts))
        new = people[-1] + 0.3 * rng.standard_normal()
        risk = risk_of(LeftOutOdds(tuple(odds + 3.0), groups), 0.1)
        wrong.append(expit(new + 3.0) > risk.threshold)
    assert 0.06 < np.mean(wrong) < 0.115


def test_few_people_keep_the_stated_bound_where_the_requested_one_fails(rng):
    """One person in ten is unlike the others: 5 % asked of four, 20 % stated."""
    wrong = []
    for _ in range(300):
        people = 12.0 * (rng.random(44) < 0.1) + 0.6 * rng.standard_normal(44)
        odds = np.maximum(people[:, None] + rng.standard_normal((44, 8)), 0.0)
        known = tuple(f"p{k}" for k in np.repeat(np.arange(4), 8))
        risk = risk_of(LeftOutOdds(tuple(odds[:4].ravel()), known), 0.05)
        wrong.append(np.mean(expit(odds[4:]) > risk.threshold))
    assert 0.05 < np.mean(wrong) < risk.bound == pytest.approx(0.2)


def test_too_few_say_what_holds_and_how_many_it_takes():
    few = risk_of(LeftOutOdds((1.0, 2.0, 1.5), ("anna", "anna", "ben")), 0.05)
    assert few.bound == pytest.approx(1.0 / 3.0) and few.n_needed == 19
    assert "33%" in str(few) and "takes 19 groups" in str(few)
    assert few.threshold > expit(2.0)
    assert "told apart" not in str(few)
    names = tuple(f"{UNNAMED}{k}" for k in (1, 1, 2))
    guessed = risk_of(LeftOutOdds((1.0, 2.0, 1.5), names), 0.05)
    assert guessed == few._replace(told_apart=True)
    assert "2 groups of demonstrations told apart by their movements" in str(guessed)
    assert "record more" not in str(risk_of(of_nobody(np.arange(20.0)), 0.05))
    assert risk_of(of_nobody(np.arange(20.0)), 0.01).n_needed == 99


def test_a_group_counts_once_and_without_weights_all_count_alike(rng):
    """Ninety demonstrations of a person are no more than one of another."""
    odds = (9.0,) * 90 + tuple(np.linspace(0.0, 1.0, 19))
    groups = ("anna",) * 90 + tuple(f"p{k}" for k in range(19))
    assert risk_of(LeftOutOdds(odds, groups), 0.1).threshold < expit(1.01)
    values = rng.standard_normal(30)
    own = np.full(30, 1.0 / 31.0)
    for accepted in (0.01, 0.05, 0.3):
        assert conformal_bound(values, accepted) == conformal_bound(values, accepted, own)

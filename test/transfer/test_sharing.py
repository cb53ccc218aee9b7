# SPDX-License-Identifier: Apache-2.0
"""Shares of a load and grip forces."""

import numpy as np
import pytest

from intent_recognition.transfer import LIGHTEST_N, away_from_base, carrying_grip
from intent_recognition.transfer.sharing import MOST_N, load_share, offering_grip

AHEAD = np.array([1.0, 0.0, 0.0])
WEIGHT_N = 6.0


def on_hand(*extra):
    return np.array([0.0, 0.0, -WEIGHT_N]) + extra


@pytest.mark.parametrize("lifted", [0.0, 0.25, 0.5, 1.0])
def test_a_lift_is_a_share_of_the_weight(lifted):
    assert load_share(on_hand(0, 0, lifted * WEIGHT_N), WEIGHT_N, AHEAD) == pytest.approx(lifted)


def test_a_pull_toward_the_person_counts_and_pushes_do_not():
    assert load_share(on_hand(3.0, 0.0, 0.0), WEIGHT_N, AHEAD) == pytest.approx(0.5)
    assert load_share(on_hand(2.0, 0.0, 3.0), WEIGHT_N, AHEAD) == pytest.approx(5.0 / 6.0)
    for push in ([-8.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, -8.0]):
        assert load_share(on_hand(*push), WEIGHT_N, AHEAD) == 0.0


def test_without_a_person_tracked_any_level_way_counts():
    assert load_share(on_hand(0.0, -6.0, 0.0), WEIGHT_N, None) == pytest.approx(1.0)


def test_something_light_takes_a_pull_that_can_be_felt():
    taken = np.array([0.0, 0.0, -0.2 + 0.5 * LIGHTEST_N])
    assert load_share(taken, 0.2, AHEAD) == pytest.approx(0.5)


def test_the_grip_falls_linearly_with_the_share_and_holds_what_it_carries():
    shares = np.linspace(0.0, 1.0, 11)
    grips = [offering_grip(share, WEIGHT_N) for share in shares]
    np.testing.assert_allclose(np.diff(grips, 2), 0.0, atol=1e-12)
    assert grips[0] == carrying_grip(WEIGHT_N)
    assert np.all(np.diff(grips) < 0.0)
    friction = 0.6
    for load_n in (0.0, 1.0, 8.0):
        assert 2.0 * friction * carrying_grip(load_n) >= 1.5 * load_n
    assert carrying_grip(1e3) == MOST_N


def test_the_way_to_the_person_is_horizontal_and_none_straight_up():
    np.testing.assert_allclose(away_from_base(np.array([3.0, 4.0, 12.0])), [0.6, 0.8, 0.0])
    assert away_from_base(np.array([0.0, 0.0, 2.0])) is None

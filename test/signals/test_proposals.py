# SPDX-License-Identifier: Apache-2.0
"""Interactions proposed from motion alone: as many as were done, where they were done."""

import numpy as np
import pytest
from simulation import minimum_jerk

from intent_recognition.signals import Signal, propose_spans

RATE_HZ = 100.0
HOME = np.array([1.0, 0.0])
TOLERANCE_S = 0.1


def course(start, moves, length_s):
    """(onset, duration, goal) of each movement to positions (T, 2), with a sensor's noise."""
    times = np.arange(0.0, length_s, 1.0 / RATE_HZ)
    place, path = np.asarray(start, float), np.tile(np.asarray(start, float), (len(times), 1))
    for onset_s, duration_s, goal in moves:
        done = minimum_jerk((times - onset_s) / duration_s)[:, None]
        path = path + done * (np.asarray(goal, float) - place)
        place = np.asarray(goal, float)
    noise = 0.0005 * np.random.default_rng(0).standard_normal(path.shape)
    return Signal(("x", "y"), (times * 1e9).astype(np.int64), path + noise, "m")


def seconds(spans):
    return np.array([[span.start_ns, span.end_ns] for span in spans]) * 1e-9


def test_a_way_there_and_back_is_one_interaction_up_to_the_way_back():
    moves = []
    for k in range(4):
        moves += [(1.0 + 6.0 * k, 2.0, (0.6, 0.1 * k)), (4.2 + 6.0 * k, 1.2, HOME)]
    found = seconds(propose_spans([course(HOME, moves, 26.0)], []))
    wanted = [[1.0 + 6.0 * k, 3.0 + 6.0 * k] for k in range(4)]
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE_S)


def test_an_interaction_lasts_until_both_agents_rest_and_pauses_divide_none():
    human, robot = [], []
    for t in (1.0, 11.0, 21.0):
        human += [(t, 1.0, (0.7, 0.3)), (t + 1.5, 1.2, (0.6, 0.0)), (t + 6.0, 1.0, HOME)]
        robot += [(t + 0.5, 1.0, (0.2, 0.2)), (t + 3.1, 1.5, (0.5, 0.1)), (t + 6.0, 1.0, (0, 0))]
    spans = propose_spans([course(HOME, human, 30.0)], [course((0, 0), robot, 30.0)])
    wanted = [[t, t + 4.6] for t in (1.0, 11.0, 21.0)]
    np.testing.assert_allclose(seconds(spans), wanted, atol=TOLERANCE_S)


def test_movements_that_begin_and_end_at_home_are_interactions_each():
    """As a wave or a handshake, recorded from rest to rest."""
    times = np.arange(0.0, 20.0, 1.0 / RATE_HZ)
    path = np.tile(HOME, (len(times), 1))
    for t in (1.0, 6.0, 11.0, 16.0):
        done = minimum_jerk((times - t) / 1.2) - minimum_jerk((times - t - 1.2) / 1.2)
        path = path + done[:, None] * np.array([-0.4, 0.1])
    path += 0.0005 * np.random.default_rng(0).standard_normal(path.shape)
    signal = Signal(("x", "y"), (times * 1e9).astype(np.int64), path, "m")
    found = seconds(propose_spans([signal], []))
    wanted = [[t, t + 2.4] for t in (1.0, 6.0, 11.0, 16.0)]
    np.testing.assert_allclose(found, wanted, atol=TOLERANCE_S)


@pytest.mark.parametrize("length_s", [0.02, 5.0])
def test_rest_alone_proposes_nothing(length_s):
    times = np.arange(0.0, length_s, 1.0 / RATE_HZ)
    still = Signal(("x",), (times * 1e9).astype(np.int64), np.ones((len(times), 1)), "m")
    assert propose_spans([still], []) == []

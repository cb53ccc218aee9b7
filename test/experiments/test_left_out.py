# SPDX-License-Identifier: Apache-2.0
"""Predictions of left-out demonstrations against independent answers."""

import numpy as np

from experiments.left_out import FINAL, WHOLE, pairs_of, predict, rms, try_numbers
from experiments.settings import Settings
from intent_recognition.signals import Demonstration


def demonstration(name: str, goal: np.ndarray, response: np.ndarray) -> Demonstration:
    """Both agents rest, move with a smooth ramp to where they go, and rest."""
    times = np.arange(250) * 0.01
    progress = np.clip((times - 0.5) / 1.5, 0.0, 1.0)
    progress = (progress**2 * (3 - 2 * progress))[:, None]
    return Demonstration.from_arrays(times, progress * goal, progress * response, name=name)


def two_rules():
    """Twelve demonstrations of each of two linear rules from the human's goal to the robot's."""
    rng = np.random.default_rng(0)
    demonstrations, kinds = [], []
    for kind in (0, 1):
        for number in range(12):
            goal = np.array([-0.3, 0.0, 0.3 * (2 * kind - 1)]) + 0.05 * rng.standard_normal(3)
            response = (1 if kind else -1) * np.array([goal[0] + 2 * goal[1], 1.0 + goal[1]])
            demonstrations.append(demonstration(f"{kind}_{number}", goal, response))
            kinds.append(kind)
    pairs = pairs_of(demonstrations)
    return pairs, np.array(kinds), try_numbers(pairs, 2, Settings())


def test_two_rules_are_told_apart_and_predicted_without_the_left_out_one():
    pairs, kinds, ((one, two), chosen) = two_rules()
    assert chosen == two.number == 2
    labels = two.labels
    assert len(set(zip(labels.tolist(), kinds.tolist(), strict=True))) == 2
    for seen in (WHOLE, FINAL):
        predicted = predict(pairs, two.mixtures, seen)
        np.testing.assert_array_equal(predicted.component, labels)  # in the labels' order
        np.testing.assert_allclose(predicted.probability.sum(axis=1), 1.0)
        single = predict(pairs, one.mixtures, seen)
        error, worse = (rms(p.mean - pairs.controlled).mean() for p in (predicted, single))
        assert error < 0.05 and error < 0.5 * worse
    for i in range(len(pairs.names)):
        used = two.mixtures.rows[i][two.mixtures.row_weight[i] > 0]
        assert i not in used
    other = 1 - two.labels
    predicted = predict(pairs, two.mixtures, FINAL, other)
    np.testing.assert_array_equal(predicted.component, other)
    assert rms(predicted.mean - pairs.controlled).min() > 0.5

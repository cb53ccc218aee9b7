# SPDX-License-Identifier: Apache-2.0
"""The shortcut on the position fails, the history tells: on the shipped seed and on fresh ones."""

import numpy as np
import pytest

from experiments.teaching.demonstration import TEST_COUNTS, TRAINING_COUNTS
from experiments.teaching.hardness import (
    draw_set,
    gaussian_labels,
    hardness_table,
    measure_hardness,
    nearest_mean_labels,
)


def measured_with(seed):
    return measure_hardness(draw_set(seed, TRAINING_COUNTS, 0), draw_set(seed, TEST_COUNTS, 1))


@pytest.mark.slow
def test_shipped_and_fresh_demonstrations_are_hard_for_the_shortcut_and_easy_for_the_history():
    shipped, *fresh = (measured_with(seed) for seed in (1, *range(100, 106)))
    assert max(m.position_leave_one_out for m in (shipped, *fresh)) <= 0.85
    assert shipped.separation_m > 0.05  # against millimetres of noise
    for some in ([shipped], fresh):
        assert np.mean([m.position_test for m in some]) <= 0.85
        assert np.mean([m.history_leave_one_out for m in some]) >= 0.97
        assert np.mean([m.history_test for m in some]) >= 0.97


@pytest.mark.slow
def test_sets_share_no_movement_and_the_readme_has_what_is_measured(repository):
    train, test = draw_set(1, TRAINING_COUNTS, 0), draw_set(1, TEST_COUNTS, 1)
    assert (len(train), len(test)) == (48, 12)
    goals = np.array([d.reach.goal_m for d in train + test])
    distances = np.linalg.norm(goals[:, None] - goals, axis=2) + np.eye(60)
    assert distances.min() > 1e-3
    assert hardness_table(1) in (repository / "bags" / "README.md").read_text()


def test_classifiers_on_plain_cases():
    labels = np.repeat([0, 1], 20)
    rng = np.random.default_rng(0)
    train = rng.standard_normal((40, 2)) + labels[:, None] * np.array([6.0, 0.0])
    test = np.array([[0.5, 3.0], [5.5, -3.0]])
    assert nearest_mean_labels(train, labels, test).tolist() == [0, 1]
    assert gaussian_labels(train, labels, test).tolist() == [0, 1]
    # Only the covariance tells these apart: a thin class difference across a wide spread.
    stretched = rng.standard_normal((400, 2)) * [10.0, 0.1]
    labels = np.tile([0, 1], 200)
    stretched[:, 1] += labels
    assert np.mean(gaussian_labels(stretched, labels, stretched) == labels) > 0.95

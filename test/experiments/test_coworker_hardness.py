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
def test_shipped_demonstrations_are_hard_for_the_shortcut_and_easy_for_the_history():
    measured = measured_with(1)
    assert measured.position_leave_one_out <= 0.85
    assert measured.position_test <= 0.85
    assert measured.history_leave_one_out >= 0.97
    assert measured.history_test >= 0.97
    # Several centimetres between the tasks, against millimetres of noise.
    assert measured.separation_m > 0.05


@pytest.mark.slow
def test_fresh_seeds_are_as_hard():
    measured = [measured_with(seed) for seed in range(100, 106)]
    assert max(m.position_leave_one_out for m in measured) <= 0.85
    assert np.mean([m.position_test for m in measured]) <= 0.85
    assert np.mean([m.history_leave_one_out for m in measured]) >= 0.97
    assert np.mean([m.history_test for m in measured]) >= 0.97


@pytest.mark.slow
def test_training_and_test_sets_share_no_movement():
    train, test = draw_set(1, TRAINING_COUNTS, 0), draw_set(1, TEST_COUNTS, 1)
    assert (len(train), len(test)) == (48, 12)
    goals = np.array([d.reach.goal_m for d in train + test])
    distances = np.linalg.norm(goals[:, None] - goals, axis=2) + np.eye(60)
    assert distances.min() > 1e-3


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
    hits = gaussian_labels(stretched, labels, stretched) == labels
    assert hits.mean() > 0.95
    assert np.mean(nearest_mean_labels(stretched, labels, stretched) == labels) == pytest.approx(
        hits.mean(), abs=0.5
    )


@pytest.mark.slow
def test_table_in_the_readme_is_what_is_measured(repository):
    assert hardness_table(1) in (repository / "bags" / "README.md").read_text()

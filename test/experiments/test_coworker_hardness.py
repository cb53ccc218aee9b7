# SPDX-License-Identifier: Apache-2.0
"""The shortcut on the position fails, the history tells: on the shipped seed and on fresh ones."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import gathered

from experiments.teaching.demonstration import TEST_COUNTS, TRAINING_COUNTS
from experiments.teaching.hardness import (
    draw_set,
    gaussian_labels,
    hardness_table,
    measure_hardness,
    nearest_mean_labels,
)
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.filtering import MovementFilter, fixed_prior_grid
from intent_recognition.learning import TrainingSettings
from intent_recognition.signals import merge


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


@pytest.mark.slow
def test_the_library_recognises_where_a_shortcut_on_the_position_fails(repository):
    """After 30 % of the movement, as the metadata say when the coworker's reach began and ended."""
    train, test = [], []
    for demonstrations, name in ((train, "train"), (test, "test")):
        for one in read_demonstrations(repository / "bags/toolbox" / name, load_dofs())[0]:
            start_ns, end_ns = (int(one.metadata[f"human_{at}_ns"]) for at in ("onset", "end"))
            demonstrations.append(replace(one, start_ns=start_ns, end_ns=end_ns))
    library, right = gathered(train, TrainingSettings(segmentation="recording")).library, []
    for one in test:
        run = MovementFilter(library, fixed_prior_grid(library, one.duration_s), one.start_ns)
        until_ns = one.start_ns + round(0.3 * one.duration_s * 1e9)
        for observation in merge([s.between(one.start_ns, until_ns) for s in one.observed]):
            run.observe(observation)
        probabilities = run.posterior(until_ns).probabilities[:-1]
        right.append(library.labels[np.argmax(probabilities)] == one.task)
    assert np.mean(right) >= 0.95

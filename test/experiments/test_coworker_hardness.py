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
from intent_recognition.filtering import MovementFilter, fixed_prior_grid, task_posterior
from intent_recognition.learning import TrainingSettings
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, merge


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


def human_movement(demonstration: Demonstration) -> Demonstration:
    """The recording from the onset to the end of the coworker's reach, as its metadata say."""
    return replace(
        demonstration,
        start_ns=int(demonstration.metadata["human_onset_ns"]),
        end_ns=int(demonstration.metadata["human_end_ns"]),
    )


def _recognise(library: TaskLibrary, demonstration: Demonstration, share: float) -> int:
    duration = (demonstration.end_ns - demonstration.start_ns) * 1e-9
    until = demonstration.start_ns + round(share * duration * 1e9)
    seen = [s.between(demonstration.start_ns, until) for s in demonstration.observed]
    hypotheses = fixed_prior_grid(library, duration)
    run = MovementFilter(library, hypotheses, demonstration.start_ns)
    for observation in merge(seen):
        run.observe(observation)
    posterior = task_posterior(run.log_evidence, hypotheses, share * duration)
    return int(np.argmax(posterior.probabilities[:-1]))


@pytest.mark.slow
def test_the_library_recognises_where_a_shortcut_on_the_position_fails(repository):
    """The shortcut is measured in test_coworker_hardness.py: right in at most 0.85."""
    train, test = (
        [human_movement(d) for d in read_demonstrations(folder, load_dofs())[0]]
        for folder in (repository / "bags/toolbox" / name for name in ("train", "test"))
    )
    library = gathered(train, TrainingSettings(segmentation="recording")).library
    right = [_recognise(library, d, 0.3) == library.labels.index(d.task) for d in test]
    assert np.mean(right) >= 0.95

# SPDX-License-Identifier: Apache-2.0
"""Recognition's regularisation: its log loss against a written-out loop, and the rule."""

import numpy as np
import pytest
from simulation import make_library, simulate

from intent_recognition.filtering.hypotheses import make_hypotheses
from intent_recognition.filtering.movement import MovementFilter
from intent_recognition.learning.examples import sample_phases
from intent_recognition.learning.held_out_recognition import least_noise, recognition_losses
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.training import learn_with_report
from intent_recognition.recognition.posterior import task_posterior
from intent_recognition.signals.observation import Observation

SETTINGS = TrainingSettings(n_basis=6, n_aligned_basis=6, segmentation="recording")


def recordings(n_tasks, n):
    rng = np.random.default_rng(8)
    truth = make_library(np.random.default_rng(4), n_tasks=n_tasks, groups=(2,), n_basis=6)
    return [simulate(truth, i % n_tasks, rng, name=f"demo_{i:02d}", rate_hz=30.0) for i in range(n)]


def test_left_out_demonstrations_are_recognised_a_little_less_surely_than_by_the_bank():
    report = learn_with_report(recordings(3, 30), SETTINGS)
    library = report.library
    tasks = report.trained.tasks
    strength = report.chosen.recognition_strength
    found = recognition_losses(library, tasks, report.trained.preprocessing, strength)
    hypotheses = make_hypotheses(library)
    expected = []
    for label, task in tasks.items():
        for example in task.examples:
            run = MovementFilter(library, hypotheses, 0)
            losses = []
            for phase, values in zip(sample_phases(), example.observed, strict=True):
                stamp_ns = round(phase * example.duration_s * 1e9)
                run.observe(Observation(stamp_ns, 0, values))
                evidence = task_posterior(
                    run.log_evidence, hypotheses, stamp_ns * 1e-9
                ).log_evidence[:-1]
                own = evidence[library.labels.index(label)]
                losses.append(np.logaddexp.reduce(evidence) - own)
            expected.append(np.mean(losses))
    assert len(found) == len(expected)
    assert np.mean(expected) < np.mean(found) < np.mean(expected) + 0.5


def test_one_task_has_nothing_to_tell_apart():
    report = learn_with_report(recordings(1, 6), SETTINGS)
    library = report.library
    trained = report.trained
    assert recognition_losses(library, trained.tasks, trained.preprocessing, 1.0).size == 0


@pytest.mark.parametrize(
    ("losses", "expected"),
    [
        (np.array([[1.0, 3.0, 1.0, 3.0], [1.0, 2.9, 1.0, 2.9]]), 1),
        (np.array([[1.0, 1.1, 1.0, 1.1], [0.0, 2.0, 0.0, 2.0]]), 0),
        (np.array([[2.0, 2.1, 2.0, 2.1], [0.1, 0.2, 0.1, 0.3], [0.1, 0.2, 0.1, 0.2]]), 1),
        (np.zeros((3, 0)), 0),
    ],
)
def test_the_first_within_one_paired_standard_error(losses, expected):
    assert least_noise(losses) == expected

# SPDX-License-Identifier: Apache-2.0
"""Regressions are uncertain where people who were left out say so, and then hold new ones."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import minimum_jerk

from intent_recognition.gaussian.normal import Gaussian
from intent_recognition.learning import (
    Trained,
    TrainingSettings,
    example_of,
    learn_with_report,
    regression_variance,
)
from intent_recognition.learning.hyperparameters import REGRESSION_VARIANCES, is_clear
from intent_recognition.learning.regression_variance import choose_regression_variance
from intent_recognition.promp import controlled_weights, dof_variance
from intent_recognition.signals.demonstration import Demonstration

SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=8, segmentation="recording", switching=False)
GOALS = np.array([[0.5, -0.2, 0.1], [0.4, 0.3, 0.0]])


def recorded(rng, people: int, n: int, habit: float, name: str) -> list[Demonstration]:
    """People of their own height, whom the robot meets in the same way or, by habit, their own."""
    found, times_s = [], np.linspace(0.0, 2.0, 101)
    course = minimum_jerk(times_s / 2.0)[:, None]
    for person in range(people):
        height, own = 0.08 * rng.normal(size=3), habit * rng.normal(size=2)
        for task, number in np.ndindex(len(GOALS), n):
            apart = height + 0.02 * rng.normal(size=3)
            hand = height + course * (GOALS[task] + apart - height)
            robot = course * (GOALS[task, :2] + 0.8 * apart[:2] + own * height[2])
            noisy = [part + 0.002 * rng.normal(size=part.shape) for part in (hand, robot)]
            labels = {"task": f"task_{task}", "group": f"{name}_{person}"}
            labels["name"] = f"{labels['group']}_{task}_{number}"
            found.append(Demonstration.from_arrays(times_s, *noisy, controlled_unit="m", **labels))
    return found


def inside(trained: Trained, recordings: list[Demonstration], variance: float) -> float:
    """Share of the robot's positions within two standard deviations, the human's weights known."""
    library, covered = replace(trained.library, regression_variance=variance), []
    design = library.basis.design_matrix(np.linspace(0.1, 1.0, 10))
    for recording in recordings:
        example = example_of(recording, trained.preprocessing)
        weights = (example.aligned if trained.chosen.aligned else example).weights
        n, task = library.n_observed, library.labels.index(recording.task)
        known = Gaussian(weights[:n].ravel(), np.zeros((n * weights.shape[1],) * 2))
        found = controlled_weights(library, task, known)
        error = design @ (weights[n:] - found.mean.reshape(weights[n:].shape)).T
        variance = dof_variance(design, found.covariance) + library.control_noise_variance()
        covered.append(np.mean(error**2 < 4.0 * variance))
    return float(np.mean(covered))


@pytest.mark.slow
@pytest.mark.usefixtures("usually_left_out")
def test_new_people_are_within_two_standard_deviations_whom_the_robot_meets_in_their_own_way():
    covered = []
    for seed in (7, 8, 9):
        rng = np.random.default_rng(seed)
        trained = learn_with_report(recorded(rng, 6, 3, 0.5, "known"), SETTINGS).trained
        others, chosen = recorded(rng, 20, 1, 0.5, "new"), trained.chosen.regression_variance
        assert chosen > 0.0
        covered.append([inside(trained, others, variance) for variance in (chosen, 0.0)])
    uncertain, certain = np.mean(covered, axis=0)
    assert uncertain > 0.9
    assert certain < 0.75


@pytest.mark.slow
@pytest.mark.usefixtures("usually_left_out")
def test_nothing_is_uncertain_where_the_robot_meets_all_in_the_same_way():
    rng = np.random.default_rng(7)
    trained = learn_with_report(recorded(rng, 6, 3, 0.0, "known"), SETTINGS).trained
    assert trained.chosen.regression_variance == 0.0
    assert inside(trained, recorded(rng, 20, 1, 0.0, "new"), 0.0) > 0.93


@pytest.mark.parametrize(("gain", "best"), [(0.2, 0), (0.3, 2)])
def test_another_variance_is_chosen_where_it_is_better_by_a_standard_error(monkeypatch, gain, best):
    """Of 16 demonstrations in two batches, whose gains have the standard deviation 1."""
    losses = np.full((len(REGRESSION_VARIANCES), 16), 5.0)
    losses[[0, 2]] = np.array([[0.0], [-gain]]) + [[0.0], [1.0]] * (-1.0) ** np.arange(16)
    monkeypatch.setattr(regression_variance, "_losses", lambda _, some, *rest: losses[:, some])
    monkeypatch.setattr(regression_variance, "batches_of", lambda _, of: (of[:1], of[1:]))
    found = choose_regression_variance(None, range(16), {}, [0.5])
    assert found == REGRESSION_VARIANCES[best]
    assert is_clear(losses[0] - losses[2], 0.5) and not is_clear(losses[0] - losses[2], 2.0)

# SPDX-License-Identifier: Apache-2.0
"""Reactive prediction: the baselines by hand, and scores at the moments that are asked for."""

import numpy as np
from simulation import make_library, simulate

from intent_recognition.evaluation.reactive import (
    HORIZONS_S,
    N_NEAREST,
    NearestWindows,
    ReactiveCase,
)
from intent_recognition.evaluation.scores import ScoreTable, sample
from intent_recognition.evaluation.scoring import EvaluationRecords, score_demonstration
from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.promp.prediction import StartPosture


def test_nearest_windows_are_those_of_a_search_through_all(rng):
    library = make_library(rng)
    *training, test = (simulate(library, k % 3, rng, n_samples=60) for k in range(7))
    found = NearestWindows(training).predict(test, 1.1)
    interval_s = np.median([np.median(np.diff(one.observed[0].stamps_ns)) for one in training])
    back_s = np.arange(4, -1, -1) * interval_s * 1e-9
    window = sample(test.observed, test.start_ns, 1.1 - back_s)
    distances, poses = [], []
    for one in training:
        for end_s in np.arange(4, one.duration_s / back_s[3]) * back_s[3]:
            distances.append(
                np.sum((sample(one.observed, one.start_ns, end_s - back_s) - window) ** 2)
            )
            poses.append(sample(one.controlled, one.start_ns, end_s + np.array(HORIZONS_S)))
    nearest = np.argsort(distances)[:N_NEAREST]
    np.testing.assert_allclose(found, np.mean(np.array(poses)[nearest], axis=0), atol=1e-9)


def test_squared_errors_are_those_of_the_poses_at_each_horizon(rng):
    library = make_library(rng)
    *training, test = (simulate(library, 0, rng, n_samples=60, duration_s=2.0) for _ in range(4))
    start = StartPosture(sample(test.controlled, test.start_ns, np.zeros(1))[0], np.zeros(2))
    case, scores = ReactiveCase(NearestWindows(training), test, start), ScoreTable()
    run = MovementFilter(library, make_prior_grid(library), test.start_ns)
    case.score(scores, run, np.array([1.0, 0.0, 0.0]), 1.4)
    names = ("mse", "mse_nearest_windows", "mse_last_pose")
    table = scores.table("task_0", HORIZONS_S, ("rad",), names)
    truth = sample(test.controlled, test.start_ns, 1.4 + np.array(HORIZONS_S))
    square = run.prediction(0).mixture_at(1.4 + np.array(HORIZONS_S[:3]), start)[0] - truth[:3]
    for k, horizon in enumerate(("0.0", "0.25", "0.5")):
        np.testing.assert_allclose(table[horizon]["mse"], np.mean(square[k] ** 2))
        held = np.mean((start.position - truth[k]) ** 2)
        np.testing.assert_allclose(table[horizon]["mse_last_pose"], held)
    assert table["1.0"] == dict.fromkeys(names)  # the recording has ended by then


class Clock:
    """In place of the nearest windows: when it was asked."""

    def __init__(self):
        self.asked_s = []

    def predict(self, seen, elapsed_s):
        self.asked_s.append(elapsed_s)
        return np.zeros((len(HORIZONS_S), 1))


def test_each_moment_of_a_recording_is_scored_once(rng):
    library = make_library(rng)
    for duration_s in rng.uniform(1.0, 3.0, 5):
        test, clock = simulate(library, 0, rng, duration_s=duration_s), Clock()
        score_demonstration(EvaluationRecords(), library, [test], test, False, clock)
        expected = np.linspace(0.05, 1.0, 20) * test.duration_s
        np.testing.assert_allclose(clock.asked_s, expected)

# SPDX-License-Identifier: Apache-2.0
"""Baselines and reactive predictions by hand, and the moments at which these are scored."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, demonstration_of, make_library, simulate

from intent_recognition.evaluation.reactive import (
    HORIZONS_S,
    N_NEAREST,
    NearestWindows,
    score_reactive,
)
from intent_recognition.evaluation.scores import (
    ScoreTable,
    mean_of_task,
    nearest_neighbour,
    sample,
)
from intent_recognition.evaluation.scoring import EvaluationRecords, score_demonstration
from intent_recognition.filtering import MovementFilter, make_prior_grid
from intent_recognition.promp import StartPosture
from intent_recognition.signals import Demonstration, Signal

PHASES = np.linspace(0.0, 1.0, 11)


def line(name: str, human_to: float, robot_to: float, duration_s: float = 1.0) -> Demonstration:
    """Both agents go from 0 along straight lines."""
    times = np.linspace(0.0, duration_s, 41)
    share = (times / duration_s)[:, None]
    return demonstration_of(times, human_to * share, share * [robot_to, -robot_to], name)


def test_samples_are_held_at_the_ends_and_means_by_phase_or_by_the_clock():
    stamps = START_NS + np.array([1, 2]) * 1_000_000_000
    one = Signal(("x", "y"), stamps, [[0.0, 10.0], [2.0, 20.0]], "m")
    other = Signal(("z",), stamps + 500_000_000, [[5.0], [7.0]], "m")
    found = sample((one, other), START_NS, np.array([0.0, 1.5, 2.0, 9.0]))
    expected = [[0.0, 10.0, 5.0], [1.0, 15.0, 5.0], [2.0, 20.0, 6.0], [2.0, 20.0, 7.0]]
    np.testing.assert_allclose(found, expected)
    training = [line("fast", 1.0, 1.0, 1.0), line("slow", 1.0, 3.0, 4.0)]
    test = line("test", 1.0, 9.0, 2.0)
    by_phase = mean_of_task(training, test, PHASES, known=True)
    np.testing.assert_allclose(by_phase[:, 0], 2.0 * PHASES, atol=1e-12)
    by_clock = mean_of_task(training, test, PHASES, known=False)
    times = 2.0 * PHASES
    expected = (np.minimum(times, 1.0) + 3.0 * times / 4.0) / 2.0
    np.testing.assert_allclose(by_clock[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(by_clock[:, 1], -expected, atol=1e-12)


@pytest.mark.parametrize("known", [True, False])
def test_nearest_neighbour_takes_the_robot_of_the_most_similar_human(known):
    training = [line("near", 1.1, 5.0), line("far", 3.0, 7.0)]
    found = nearest_neighbour(training, line("test", 1.0, 0.0), PHASES, 0.5, known)
    np.testing.assert_allclose(found[:, 0], 5.0 * PHASES, atol=1e-12)


def test_nearest_neighbour_looks_no_further_than_what_was_observed():
    training = [line("same", 1.0, 5.0), line("other", 2.0, 7.0)]
    late = line("test", 1.0, 0.0)
    turned = late.observed[0].values.copy()
    turned[21:] = 2.0 * np.linspace(0.5, 1.0, 20)[:, None]
    test = replace(late, observed=(replace(late.observed[0], values=turned),))
    early = nearest_neighbour(training, test, PHASES, 0.5, True)
    np.testing.assert_allclose(early[:, 0], 5.0 * PHASES, atol=1e-12)
    assert nearest_neighbour(training, test, PHASES, 1.0, True)[-1, 0] == pytest.approx(7.0)


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
    scores = ScoreTable()
    run = MovementFilter(library, make_prior_grid(library), test.start_ns)
    windows = NearestWindows(training)
    score_reactive(scores, run, np.array([1.0, 0.0, 0.0]), test, 1.4, start, windows)
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

# SPDX-License-Identifier: Apache-2.0
"""The baselines by hand on recordings of a few samples."""

from dataclasses import replace

import numpy as np
import pytest
from simulation import START_NS, demonstration_of

from intent_recognition.evaluation.scores import mean_of_task, nearest_neighbour, sample
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

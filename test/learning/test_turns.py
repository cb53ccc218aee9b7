# SPDX-License-Identifier: Apache-2.0
"""Angles in other turns: what is learned and predicted is the same, in the turn of the arm."""

import numpy as np
import pytest
from simulation import demonstration_of, minimum_jerk

from intent_recognition.learning import TrainingSettings, learn
from intent_recognition.recognition import IntentEstimator, predict_controlled, recognize_task
from intent_recognition.signals.demonstration import Demonstration

TIMES = np.arange(0.0, 2.5, 0.02)
SETTINGS = TrainingSettings(n_basis=8, n_aligned_basis=10, switching=False)
TURN = 2 * np.pi


def wrap(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % TURN - np.pi


def movement(rng, task: int) -> tuple[np.ndarray, np.ndarray]:
    """An elbow and a joint that turn through pi, and a wrist in metres; nothing is quite at rest,
    where rounding would choose between alignments that are equal."""
    reach = minimum_jerk((TIMES - 0.5) / 1.5)
    size = 1.0 + 0.1 * rng.normal()
    elbow = 3.0 + 0.05 * rng.normal() + (0.7 - 1.2 * task) * size * reach
    joint = np.pi + 0.05 * rng.normal() + (0.5 + task) * size * reach
    exact = np.stack([elbow, size * reach, joint], axis=1)
    noisy = exact + 0.001 * rng.normal(size=exact.shape)
    return noisy[:, :2], noisy[:, 2:]


def demonstrations(wrapped: bool) -> list[Demonstration]:
    rng = np.random.default_rng(3)
    found = []
    for k in range(12):
        human, robot = movement(rng, k % 2)
        if wrapped:
            human, robot = wrap(human), wrap(robot) + TURN * (k % 3)
        both = TIMES, human, robot, f"{k:02}", f"{k % 2}", ("rad", "rad")
        found.append(demonstration_of(*both))
    return found


@pytest.fixture(scope="module")
def libraries():
    return [learn(demonstrations(wrapped), SETTINGS) for wrapped in (False, True)]


def test_wrapped_recordings_teach_and_tell_what_unwrapped_ones_do(libraries):
    plain, wrapped = libraries
    np.testing.assert_allclose(wrapped.weight_covariance, plain.weight_covariance, atol=1e-9)
    turns = (wrapped.weight_mean - plain.weight_mean) / TURN
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)
    assert wrapped.noise_scale == plain.noise_scale
    human, _ = movement(np.random.default_rng(8), 1)
    found = []
    for library, seen in zip(libraries, (human, wrap(human)), strict=True):
        estimate = recognize_task(library, TIMES, seen, onset_s=0.5)
        found.append([*estimate.probabilities])
        path = predict_controlled(library, TIMES, seen, onset_s=0.5).positions
        found[-1] += list(np.cos(path[:, 0]))
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


@pytest.mark.parametrize("turn", [-1, 0, 2])
def test_whatever_turn_the_person_and_the_arm_are_in_the_prediction_is_the_arms(libraries, turn):
    plain, wrapped = libraries
    human, robot = movement(np.random.default_rng(8), 1)
    ends = []
    for library, seen, arm in (
        (plain, human, robot[0]),
        (wrapped, wrap(human) + TURN * turn, robot[0] + TURN * turn),
    ):
        estimator = IntentEstimator(library, switching=False)
        for stamp_s, values in zip(TIMES[:90], seen, strict=False):
            estimator.observe_controlled(1.0 + stamp_s, arm)
            estimate = estimator.observe(1.0 + stamp_s, values)
        assert estimate.task == "1"
        pose = estimator.predict_controlled_at(1.0 + TIMES[89])
        ends.append(
            np.r_[estimator.predict_controlled().trajectory.positions[-1], pose.positions[0]]
        )
    np.testing.assert_allclose(ends[1] - TURN * turn, ends[0], atol=1e-6)

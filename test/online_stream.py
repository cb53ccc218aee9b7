# SPDX-License-Identifier: Apache-2.0
"""Streams of observations for tests of the online estimator, and what comes out of it."""

import numpy as np
from simulation import make_library, minimum_jerk, simulate

from intent_recognition.learning.training import TrainingSettings, learn
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.recognition.estimator import Estimate, IntentEstimator
from intent_recognition.signals import Demonstration, Observation


def humans() -> TaskLibrary:
    """What the simulated humans do."""
    rng = np.random.default_rng(5)
    return make_library(rng, n_tasks=3, n_basis=10, spread=0.03, noise_std=0.001)


def learned(truth: TaskLibrary) -> TaskLibrary:
    rng = np.random.default_rng(6)
    recordings = [
        movement(truth, i % truth.n_tasks, rng, name=f"demo_{i}") for i in range(12 * truth.n_tasks)
    ]
    return learn(recordings, TrainingSettings(n_basis=10))


def feed(estimator: IntentEstimator, observations) -> list[Estimate]:
    estimates = []
    for observation in observations:
        assert estimator.reason_to_reject(observation) is None
        estimates.append(estimator.update(observation))
    return estimates


def follow(estimator: IntentEstimator, observations, elapsed_s: float) -> tuple[Estimate, list]:
    """The estimate so long after an onset, and the observations up to then."""
    seen = []
    for observation in observations:
        seen.append(observation)
        estimate = estimator.update(observation)
        if estimate.moving and (estimate.stamp_ns - estimate.onset_ns) * 1e-9 > elapsed_s:
            return estimate, seen
    raise AssertionError("no movement was that long")


def movement(library: TaskLibrary, task: int, rng, **options) -> Demonstration:
    return simulate(library, task, rng, **{"rest_before_s": 0.8, "rest_after_s": 0.8} | options)


def shifted(observations, seconds: float) -> list[Observation]:
    return [o._replace(stamp_ns=o.stamp_ns + round(seconds * 1e9)) for o in observations]


def episodes(estimates: list[Estimate]) -> list[list[Estimate]]:
    """The stretches in which a movement is under way."""
    found: list[list[Estimate]] = []
    before = False
    for estimate in estimates:
        if estimate.moving and not before:
            found.append([])
        if estimate.moving:
            found[-1].append(estimate)
        before = estimate.moving
    return found


def same(one: Estimate, other: Estimate, tolerance: float = 0.0) -> None:
    assert (one.stamp_ns, one.moving, one.onset_ns) == (
        other.stamp_ns,
        other.moving,
        other.onset_ns,
    )
    for name in ("probabilities", "phase", "log_evidence"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance, err_msg=name)


def going_back(start: Observation, goal: np.ndarray) -> list[Observation]:
    """The hand goes to `goal` in 20 s, too slowly to count as moving, and rests a while."""
    shares = minimum_jerk(np.linspace(0.0, 1.1, 440))
    m = len(goal)
    return [
        Observation(
            start.stamp_ns + 50_000_000 * (i + 1),
            0,
            start.values[:m] + s * (goal - start.values[:m]),
        )
        for i, s in enumerate(shares)
    ]

# SPDX-License-Identifier: Apache-2.0
"""What one observation, one prediction and one plan cost, and which part of them costs what."""

import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from statistics import mean, median
from unittest import mock

import numpy as np

from benchmarks.measure import Result, at_most, seconds
from benchmarks.synthetic import movement, synthetic_library
from intent_recognition.filtering import MovementFilter
from intent_recognition.filtering import filter as filters
from intent_recognition.filtering.births import Births
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.motion import JointReference, NominalTiming, make_path, plan_interaction
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Demonstration, merge

PLAN_AFTER_S = 1.0
N_TASKS = 300
PREDICT_EVERY = 4
"""Observations: 25 predictions a second at 100 Hz."""


def online(library: TaskLibrary, recorded: Demonstration) -> Iterator[Result]:
    """All benchmarks of the running nodes' work, on a recording that was not trained on."""
    onset_ns = int(recorded.metadata["human_onset_ns"])
    estimator = IntentEstimator(library)
    times: list[float] = []
    for observation in merge(recorded.observed):
        if observation.stamp_ns > onset_ns + PLAN_AFTER_S * 1e9:
            break
        start_s = time.perf_counter()
        estimator.update(observation)
        if estimator.predict_controlled() is not None:
            times.append(time.perf_counter() - start_s)
    yield at_most(
        "one observation and the trajectory after it",
        1e3 * median(times),
        10.0,
        "ms",
        f"of {len(times)}; 50 points; the tracker sends one every 10 ms",
    )
    yield _plan(estimator)
    yield _many_tasks()


def _plan(estimator: IntentEstimator) -> Result:
    prediction = estimator.predict_controlled()
    assert prediction is not None, "the reach is over"
    times, positions, velocities, _ = prediction.trajectory
    path = make_path(times, positions, LWR_LIMITS, velocities)
    nominal = NominalTiming(-PLAN_AFTER_S, path.duration_s)
    start = JointReference.at_rest(positions[0])
    work = partial(plan_interaction, path, nominal, start, LWR_LIMITS)
    return at_most(
        "one plan within the limits",
        1e3 * seconds(work, 10),
        20.0,
        "ms",
        "half the period of 25 commands a second",
    )


def _many_tasks() -> Result:
    """A reach there and back with births, in a library of many tasks; what each part takes."""
    spent: dict[str, list[float]] = defaultdict(list)

    def timed(name: str, work: Callable) -> Callable:
        def run(*arguments: object) -> object:
            start_s = time.thread_time()
            found = work(*arguments)
            spent[name].append(time.thread_time() - start_s)
            return found

        return run

    rng, whole = np.random.default_rng(1), list[float]()
    estimator = IntentEstimator(synthetic_library(rng, N_TASKS))
    there = movement(estimator.library, 0, rng, rest_s=0.6, noise_std=0.001)
    back = [one._replace(stamp_ns=2 * there[-1].stamp_ns - one.stamp_ns) for one in there[-2::-1]]
    with ExitStack() as patches:
        for owner, name in (
            (MovementFilter, "_condition"),
            (Births, "observe"),
            (filters, "task_posterior"),
        ):
            patch = mock.patch.object(owner, name, timed(name, getattr(owner, name)))
            patches.enter_context(patch)
        predict = timed("predict_controlled", estimator.predict_controlled)
        for k, one in enumerate([*there, *back]):
            start_s = time.thread_time()
            moving = estimator.update(one).moving
            if k % PREDICT_EVERY == 0:
                predict()
            if moving:
                whole.append(time.thread_time() - start_s)
    each = ", ".join(f"{name} {1e3 * mean(times):.2f}" for name, times in spent.items())
    return at_most(
        f"... {N_TASKS} tasks, births, 25 predictions a second, p99",
        1e3 * float(np.percentile(whole, 99)),
        10.0,
        "ms",
        f"mean {1e3 * mean(whole):.2f}, at an onset {1e3 * max(whole):.0f}; a call of {each} ms",
    )

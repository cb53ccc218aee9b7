# SPDX-License-Identifier: Apache-2.0
"""What one prediction and one plan cost."""

import time
from collections.abc import Iterator
from functools import partial
from statistics import median

from benchmarks.measure import Result, at_most, seconds
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.motion import JointReference, NominalTiming, make_path, plan_interaction
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Demonstration, merge

PLAN_AFTER_S = 1.0


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

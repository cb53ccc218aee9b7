# SPDX-License-Identifier: Apache-2.0
"""Memory of a running estimator, in a process of its own.

A million observations take minutes, so that run goes on beside the benchmarks no clock decides,
and stops at a limit of time.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

import numpy as np

from benchmarks.browser import resident_mb
from benchmarks.measure import Result, at_most
from benchmarks.synthetic import START_NS, movement, synthetic_library
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator
from intent_recognition.signals import Observation

PERIOD_NS = 10_000_000


N_LONG = 1_000_000


def memory() -> Result:
    """300 tasks with 10 phases."""
    with _measure(300, 10, 1_500) as process:
        large = _found(process)
    return at_most(
        "estimator of 300 tasks and 10 phases, memory",
        large["highest_mb"],
        400.0,
        "MB",
        f"of the process, {large['library_mb']:.0f} MB of it the library's weights; "
        f"{large['n_observations']} observations, {large['n_movements']} movements",
    )


def growth(process: subprocess.Popen) -> Result:
    """Of a long run, when it is over."""
    long = _found(process)
    return at_most(
        "... growth in a long run",
        long["last_mb"] - long["after_first_tenth_mb"],
        2.0,
        "MB",
        f"from {long['n_first']} to {long['n_observations']} observations, "
        f"{long['n_movements']} movements, 3 tasks",
    )


def long_run(limit_s: float) -> AbstractContextManager[subprocess.Popen]:
    """A small library's estimator at work beside what follows, ended with the context."""
    return _measure(3, 10, N_LONG, limit_s)


@contextmanager
def _measure(*numbers: float) -> Iterator[subprocess.Popen]:
    code = "from benchmarks.bank_memory import main; main()"
    command = [sys.executable, "-c", code, *map(str, numbers)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def _found(process: subprocess.Popen) -> dict[str, float]:
    return json.loads(process.communicate()[0])


def main() -> None:
    """Run an estimator for so many observations or seconds; print what memory it takes, as JSON."""
    n_tasks, n_scales, n_observations = (int(argument) for argument in sys.argv[1:4])
    end_s = time.monotonic() + float(sys.argv[4]) if len(sys.argv) > 4 else float("inf")
    rng = np.random.default_rng(1)
    library = synthetic_library(rng, n_tasks)
    estimator = IntentEstimator(library, n_scales=n_scales)
    seen = moved = 0
    start_ns, was_moving, sizes = START_NS, False, []
    while seen < n_observations:
        task = int(rng.integers(n_tasks))
        for observation in _there_and_back(library, task, rng, start_ns):
            moving = estimator.update(observation).moving
            moved += moving and not was_moving
            was_moving = moving
            start_ns = observation.stamp_ns + PERIOD_NS
            seen += 1
            if moving and seen % 10 == 0:
                estimator.predict_controlled()
        sizes.append((seen, resident_mb(os.getpid())))
        if time.monotonic() > end_s:
            break
    n_first, first_tenth = next(each for each in sizes if each[0] >= seen / 10)
    sys.stdout.write(
        json.dumps(
            {
                "n_first": n_first,
                "n_observations": seen,
                "n_movements": moved,
                "highest_mb": max(size for _, size in sizes),
                "after_first_tenth_mb": first_tenth,
                "last_mb": sizes[-1][1],
                "library_mb": library.weight_covariance.nbytes / 2**20,
            }
        )
    )


def _there_and_back(
    library: TaskLibrary, task: int, rng: np.random.Generator, start_ns: int
) -> list[Observation]:
    """A movement of the task, a rest and the way back."""
    there = movement(library, task, rng, start_ns=start_ns, rest_s=1.0, noise_std=0.001)
    back = there[::-1]
    first_ns = there[-1].stamp_ns + PERIOD_NS
    return there + [o._replace(stamp_ns=first_ns + k * PERIOD_NS) for k, o in enumerate(back)]

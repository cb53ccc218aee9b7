# SPDX-License-Identifier: Apache-2.0
"""Memory of a running estimator, in a process of its own."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.measure import Result
from benchmarks.synthetic import START_NS, movement, synthetic_library
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.observations import Observation
from intent_recognition.promp.online import IntentEstimator

PERIOD_NS = 10_000_000


def memory() -> Iterator[Result]:
    """300 tasks with 10 phases, then a long run of a small library."""
    large = _measure(300, 10, 1_500)
    yield Result(
        "estimator of 300 tasks and 10 phases, memory",
        large["highest_mb"],
        400.0,
        "at most",
        "MB",
        f"of the process, {large['library_mb']:.0f} MB of it the library's weights; "
        f"{large['n_observations']} observations, {large['n_movements']} movements",
    )
    long = _measure(3, 10, 100_000)
    yield Result(
        "... growth in a long run",
        long["last_mb"] - long["after_first_tenth_mb"],
        2.0,
        "at most",
        "MB",
        f"over the last 90 % of {long['n_observations']} observations, "
        f"{long['n_movements']} movements",
    )


def _measure(n_tasks: int, n_scales: int, n_observations: int) -> dict[str, float]:
    code = "from benchmarks.bank_memory import main; main()"
    arguments = [str(n) for n in (n_tasks, n_scales, n_observations)]
    found = subprocess.run(
        [sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True
    )
    return json.loads(found.stdout)


def main() -> None:
    """Run an estimator for so many observations and print what memory it takes, as JSON."""
    n_tasks, n_scales, n_observations = (int(argument) for argument in sys.argv[1:4])
    rng = np.random.default_rng(1)
    library = synthetic_library(rng, n_tasks)
    estimator = IntentEstimator(library, n_scales=n_scales)
    seen = moved = 0
    start_ns, was_moving, sizes = START_NS, False, []
    while seen < n_observations:
        task = int(rng.integers(n_tasks))
        for observation in _there_and_back(library, task, rng, start_ns):
            moving = estimator.observe(observation).moving
            moved += moving and not was_moving
            was_moving = moving
            start_ns = observation.stamp_ns + PERIOD_NS
            seen += 1
            if moving and seen % 10 == 0:
                estimator.predict_controlled()
        sizes.append((seen, resident_mb()))
    first_tenth = next(size for count, size in sizes if count >= n_observations / 10)
    sys.stdout.write(
        json.dumps(
            {
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


def resident_mb() -> float:
    """Memory of this process that is in use, on Linux."""
    for line in Path("/proc/self/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return float("nan")

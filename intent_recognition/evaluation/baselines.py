# SPDX-License-Identifier: Apache-2.0
"""Baselines of prediction: the task's mean and the most similar demonstration."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.signals import Demonstration, Signal


def sample(signals: Sequence[Signal], start_ns: int, times_s: Floats) -> Floats:
    """All DOFs of the signals at times after `start_ns`, held at both ends, (T, d)."""
    columns = [
        np.interp(times_s, signal.seconds(start_ns), column)
        for signal in signals
        for column in signal.values.T
    ]
    return np.stack(columns, axis=1)


def _times(recorded: Demonstration, test: Demonstration, phases: Floats, known: bool) -> Floats:
    """Times in `recorded` that correspond to phases of the test: by phase, or by the clock."""
    reference = recorded if known else test
    return phases * (reference.end_ns - reference.start_ns) * 1e-9


def mean_of_task(
    training: Sequence[Demonstration], test: Demonstration, phases: Floats, known: bool
) -> Floats:
    """Mean of the controlled agent over the demonstrations of a task, (T, Q)."""
    return np.mean(
        [sample(r.controlled, r.start_ns, _times(r, test, phases, known)) for r in training], axis=0
    )


def nearest_neighbour(
    training: Sequence[Demonstration],
    test: Demonstration,
    phases: Floats,
    fraction: float,
    known: bool,
) -> Floats:
    """Controlled agent of the demonstration whose observed agent moved most alike, (T, Q)."""
    seen = phases[phases <= fraction + 1e-9]
    observed = sample(test.observed, test.start_ns, _times(test, test, seen, known))
    distances = [
        np.mean((sample(r.observed, r.start_ns, _times(r, test, seen, known)) - observed) ** 2)
        for r in training
    ]
    nearest = training[int(np.argmin(distances))]
    return sample(nearest.controlled, nearest.start_ns, _times(nearest, test, phases, known))

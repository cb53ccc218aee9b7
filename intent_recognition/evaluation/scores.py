# SPDX-License-Identifier: Apache-2.0
"""Means of scores over held-out recordings, and baselines of prediction.

The baselines are the task's mean and the most similar demonstration.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, Signal


class ScoreTable:
    """Sums of scores over demonstrations, by kind of phase, fraction and name."""

    def __init__(self) -> None:
        self._values: dict[tuple[str, float, str], list] = defaultdict(list)

    def add(self, phase: str, fraction: float, **values: float | Floats) -> None:
        """Add one demonstration's scores: scalars, or arrays (U,) with one number per unit."""
        for name, value in values.items():
            self._values[phase, fraction, name].append(value)

    def table(
        self, phase: str, fractions: Sequence[float], units: Sequence[str], names: Sequence[str]
    ) -> dict[str, dict[str, object]]:
        """Means over demonstrations: {fraction: {name: number}}, one number per unit if several."""
        return {
            str(fraction): {
                name: _number(self._values[phase, fraction, name], units) for name in names
            }
            for fraction in fractions
        }


def _number(values: list, units: Sequence[str]) -> float | dict[str, float | None] | None:
    """Mean over demonstrations, one per unit if there are several; None without values."""
    if not values:
        return None
    mean = np.mean(np.array(values, dtype=np.float64), axis=0)
    if mean.ndim == 0:
        return float(mean)
    numbers = [None if np.isnan(x) else float(x) for x in mean]
    return numbers[0] if len(units) == 1 else dict(zip(units, numbers, strict=True))


def per_unit(library: TaskLibrary, values: Floats) -> Floats:
    """Means over the samples and the DOFs of each controlled unit, (U,), from (T, Q)."""
    units = np.array(library.controlled_units)
    if not values.size:
        return np.full(len(dict.fromkeys(units)), np.nan)
    return np.array([values[:, units == unit].mean() for unit in dict.fromkeys(units)])


def sample(signals: Sequence[Signal], start_ns: int, times_s: Floats) -> Floats:
    """Sample all DOFs of the signals at times after `start_ns`, held at both ends, (T, d)."""
    columns = [
        np.interp(times_s, signal.seconds(start_ns), column)
        for signal in signals
        for column in signal.values.T
    ]
    return np.stack(columns, axis=1)


def _times(recorded: Demonstration, test: Demonstration, phases: Floats, known: bool) -> Floats:
    """Times in `recorded` that match phases of the test: by phase if known, else by the clock."""
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
    """Controlled agent in the demonstration with the most similar observed agent, (T, Q)."""
    seen = phases[phases <= fraction + 1e-9]
    observed = sample(test.observed, test.start_ns, _times(test, test, seen, known))
    distances = [
        np.mean((sample(r.observed, r.start_ns, _times(r, test, seen, known)) - observed) ** 2)
        for r in training
    ]
    nearest = training[int(np.argmin(distances))]
    return sample(nearest.controlled, nearest.start_ns, _times(nearest, test, phases, known))

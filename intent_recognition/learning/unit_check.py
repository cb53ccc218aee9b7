# SPDX-License-Identifier: Apache-2.0
"""Check that demonstrations which are learned from together have the same units."""

from collections.abc import Mapping

from intent_recognition.learning.examples import TrainingExample
from intent_recognition.learning.preprocessing import Preprocessing
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.signals import Size, StreamFinding, differing_unit, median_size, size_of


def other_units_of(
    tasks: Mapping[str, TaskStatistics],
    usual: Mapping[str, TaskStatistics],
    preprocessing: Preprocessing,
) -> list[StreamFinding]:
    """Demonstrations with a signal in another unit than most others, each with the likely unit."""
    known = [_sizes(example, preprocessing) for task in usual.values() for example in task.examples]
    medians = {name: median_size([each[name] for each in known]) for name in known[0]}
    return [
        StreamFinding(example.name, f"{name} {found.reason}")
        for task in tasks.values()
        for example in task.examples
        for name, size in _sizes(example, preprocessing).items()
        if (found := differing_unit(size, medians[name])) is not None
    ]


def _sizes(example: TrainingExample, preprocessing: Preprocessing) -> dict[str, Size]:
    """Size of each signal's values, keyed by its first DOF."""
    found = {}
    for signals, values in (
        (preprocessing.observed, example.observed),
        (preprocessing.controlled, example.controlled),
    ):
        first = 0
        for names, unit in signals:
            found[names[0]] = size_of(unit, values[:, first : first + len(names)])
            first += len(names)
    return found

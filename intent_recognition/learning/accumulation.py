# SPDX-License-Identifier: Apache-2.0
"""Accumulation of sufficient statistics: each recording is seen once and then forgotten."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple

from intent_recognition.errors import TrainingError
from intent_recognition.learning.examples import TrainingExample
from intent_recognition.learning.preprocessing import (
    Preprocessing,
    examples_of,
    reason_against,
    settle_preprocessing,
)
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import TaskStatistics, merge_tasks, summarize
from intent_recognition.signals import Demonstration, numbered

REFERENCE_RECORDINGS = 100
"""Usable recordings at the start of a stream that determine its preprocessing; bounds memory."""
NAMES_KEPT = 1000
"""Most names of used, and of rejected, recordings that a report lists; bounds its size."""
BATCH = 16
"""Number of recordings turned into examples at a time (docs/training.md: memory and speed)."""


class Accumulated(NamedTuple):
    """Statistics of recordings, with the names of those used and rejected."""

    preprocessing: Preprocessing | None  # how examples were made; None if no recording was usable
    tasks: Mapping[str, TaskStatistics]  # statistics of each label
    used: tuple[str, ...] = ()  # names of the recordings used, the first `NAMES_KEPT`
    # (name, reason) of the recordings rejected, the first `NAMES_KEPT`
    rejected: tuple[tuple[str, str], ...] = ()
    n_rejected: int = 0

    @property
    def n_used(self) -> int:
        """Number of recordings learned from."""
        return sum(task.n for task in self.tasks.values())


def accumulate(
    recordings: Iterable[Demonstration],
    settings: TrainingSettings,
    preprocessing: Preprocessing | None = None,
) -> Accumulated:
    """Compute statistics of recordings in memory that does not grow with their number.

    Args:
        recordings: a list, whose preprocessing is determined from all its recordings; or a stream,
            read once, whose preprocessing is determined from the first `REFERENCE_RECORDINGS`
            usable ones. Recordings without the most frequent DOFs are rejected.
        settings: how to learn; ignored if `preprocessing` is given, which has its own settings.
        preprocessing: how to make examples; None to determine it from the recordings.

    Raises:
        ArgumentError: an item is not a `Demonstration`.
    """
    total = Accumulated(preprocessing, {})
    head: list[Demonstration] = []
    stream = numbered(recordings)
    limit = len(recordings) if isinstance(recordings, Sequence) else REFERENCE_RECORDINGS
    if preprocessing is None:
        for recorded in stream:
            reason = reason_against(recorded, None)
            if reason:
                total = _reject(total, recorded.name, reason)
            else:
                head.append(recorded)
            if len(head) == limit:
                break
        if not head:
            return total
        preprocessing = settle_preprocessing(head, settings)
    head.reverse()
    first = (head.pop() for _ in range(len(head)))  # frees each once used
    remaining = chain(first, stream)
    while batch := list(islice(remaining, BATCH)):
        total = merge_accumulated(total, _accumulate_batch(batch, preprocessing))
    return total


def merge_accumulated(first: Accumulated, second: Accumulated) -> Accumulated:
    """Merge two accumulations; the names of `first` come first.

    Raises:
        TrainingError: the two were accumulated with different preprocessing.
    """
    ours, theirs = first.preprocessing, second.preprocessing
    if ours and theirs and replace(ours, source="") != replace(theirs, source=""):
        expected = "the same settings, DOFs and onset thresholds in both parts"
        cure = "Accumulate all parts with one preprocessing."
        raise TrainingError.about("statistics", expected, f"{ours} and {theirs}", cure)
    return Accumulated(
        ours or theirs,
        merge_tasks(first.tasks, second.tasks),
        (first.used + second.used)[:NAMES_KEPT],
        (first.rejected + second.rejected)[:NAMES_KEPT],
        first.n_rejected + second.n_rejected,
    )


def _accumulate_batch(
    recordings: Sequence[Demonstration], preprocessing: Preprocessing
) -> Accumulated:
    total = Accumulated(preprocessing, {})
    groups: dict[str, list[TrainingExample]] = {}
    used = []
    for recorded, example in zip(recordings, examples_of(recordings, preprocessing), strict=True):
        if isinstance(example, TrainingError):
            total = _reject(total, recorded.name, str(example))
        else:
            groups.setdefault(example.task, []).append(example)
            used.append(example.name)
    tasks = {label: summarize(group) for label, group in groups.items()}
    return total._replace(tasks=tasks, used=tuple(used))


def _reject(total: Accumulated, name: str, reason: str) -> Accumulated:
    return total._replace(
        rejected=(*total.rejected, (name, reason))[:NAMES_KEPT], n_rejected=total.n_rejected + 1
    )

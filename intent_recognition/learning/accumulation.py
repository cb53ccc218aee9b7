# SPDX-License-Identifier: Apache-2.0
"""Recordings, one after the other, into statistics: each is seen once and then forgotten.

What turns a recording into an example (basis, thresholds of the onset, names of the DOFs) is the
`Reference`. It is settled before the first example is made and stays, so that statistics gathered
at other times, or by other processes, can be merged.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

from intent_recognition.errors import ArgumentError, TrainingError, describe
from intent_recognition.learning.examples import Example, cut_one, make_examples
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import TaskStatistics, merge_statistics, summarize
from intent_recognition.learning.timing import Timing, settle_timing
from intent_recognition.promp import NONE, NormalizedRBFBasis
from intent_recognition.signals import Demonstration, OnsetSettings, onset_settings

REFERENCE_RECORDINGS = 100
"""How many recordings of a stream settle the thresholds of the onset."""
NAMES_KEPT = 1000
"""How many names of recordings, used and rejected, a report lists."""
BATCH = 16
"""Recordings turned into examples at a time."""


class SignalNames(NamedTuple):
    """The DOFs of one signal and their unit."""

    names: tuple[str, ...]
    unit: str


@dataclass(frozen=True)
class Reference:
    """How each recording becomes an example.

    Attributes:
        settings: basis, ridge and segmentation among them.
        observed, controlled: DOFs of each signal.
        onset, controlled_onset: thresholds of the movement for each signal.
        timing: templates that recordings are aligned with.
        source: name of the recording that the DOFs are from.
    """

    settings: TrainingSettings
    observed: tuple[SignalNames, ...]
    controlled: tuple[SignalNames, ...]
    onset: tuple[OnsetSettings, ...]
    controlled_onset: tuple[OnsetSettings, ...]
    timing: Timing
    source: str = ""

    @property
    def basis(self) -> NormalizedRBFBasis:
        """The basis functions."""
        return NormalizedRBFBasis(self.settings.n_basis, self.settings.width)

    @property
    def forecast_basis(self) -> NormalizedRBFBasis:
        """Those of the aligned examples."""
        return NormalizedRBFBasis(self.settings.n_forecast_basis, self.settings.width)


class Accumulated(NamedTuple):
    """Statistics of recordings, and what became of each.

    Attributes:
        reference: how they became examples; None when none could be used.
        tasks: statistics of each label.
        used: names of those learned from, the first `NAMES_KEPT`.
        rejected: (name, reason) of those left out, the first `NAMES_KEPT`.
        n_rejected: how many were left out.
    """

    reference: Reference | None
    tasks: Mapping[str, TaskStatistics]
    used: tuple[str, ...] = ()
    rejected: tuple[tuple[str, str], ...] = ()
    n_rejected: int = 0

    @property
    def n_used(self) -> int:
        """How many were learned from."""
        return sum(task.n for task in self.tasks.values())


def accumulate(
    recordings: Iterable[Demonstration],
    settings: TrainingSettings,
    reference: Reference | None = None,
) -> Accumulated:
    """Statistics of recordings in memory that does not grow with their number.

    Args:
        recordings: a list, whose reference is settled by all of it; or a stream that is read
            once, whose reference is settled by its first `REFERENCE_RECORDINGS` usable ones.
        settings: how to learn; those of the reference count where one is given.
        reference: how to make examples, None to settle it.

    Raises:
        ArgumentError: an item is not a `Demonstration`.
    """
    total = Accumulated(reference, {})
    head: list[Demonstration] = []
    stream = _demonstrations(recordings)
    limit = len(recordings) if isinstance(recordings, Sequence) else REFERENCE_RECORDINGS
    if reference is None:
        for recorded in stream:
            reason = _reason_against(recorded, head[0] if head else None)
            if reason:
                total = _reject(total, recorded.name, reason)
            else:
                head.append(recorded)
            if len(head) == limit:
                break
        if not head:
            return total
        reference = settle_reference(head, settings)
    head.reverse()
    for batch in _batches(chain(_taken(head), stream), BATCH):
        total = merge_accumulated(total, _accumulate_batch(batch, reference))
    return total


def settle_reference(recordings: Sequence[Demonstration], settings: TrainingSettings) -> Reference:
    """Thresholds, templates and DOFs from usable recordings, at least one."""
    first = recordings[0]
    onset = onset_settings([recorded.observed for recorded in recordings])
    controlled_onset = onset_settings([recorded.controlled for recorded in recordings])
    if settings.segmentation == "movement":
        recordings = [cut_one(recorded, onset, controlled_onset) for recorded in recordings]
    return Reference(
        settings=settings,
        observed=_names(first.observed),
        controlled=_names(first.controlled),
        onset=onset,
        controlled_onset=controlled_onset,
        timing=settle_timing(recordings),
        source=first.name,
    )


def merge_accumulated(first: Accumulated, second: Accumulated) -> Accumulated:
    """Both together; names in this order.

    Raises:
        TrainingError: they were gathered with different references.
    """
    reference = first.reference or second.reference
    if second.reference is not None and replace(second.reference, source="") != replace(
        reference, source=""
    ):
        raise TrainingError(
            describe(
                "statistics",
                "the same settings, DOFs and onset thresholds in both parts",
                f"{reference} and {second.reference}",
                "Gather all parts with one reference.",
            )
        )
    tasks = dict(first.tasks)
    for label, task in second.tasks.items():
        tasks[label] = merge_statistics(tasks[label], task) if label in tasks else task
    return Accumulated(
        reference,
        dict(sorted(tasks.items())),
        (first.used + second.used)[:NAMES_KEPT],
        (first.rejected + second.rejected)[:NAMES_KEPT],
        first.n_rejected + second.n_rejected,
    )


def example_of(recorded: Demonstration, reference: Reference) -> Example:
    """One recording as an example.

    Raises:
        TrainingError: it cannot be used; says why.
    """
    part = _accumulate_batch([recorded], reference)
    if part.rejected:
        raise TrainingError(f"{recorded.name}: {part.rejected[0][1]}")
    (task,) = part.tasks.values()
    return task.examples[0]


def _accumulate_batch(recordings: Sequence[Demonstration], reference: Reference) -> Accumulated:
    """Statistics of a few recordings at once."""
    total = Accumulated(reference, {})
    usable = []
    for recorded in recordings:
        reason = _reason_against(recorded, reference)
        if reason:
            total = _reject(total, recorded.name, reason)
        elif reference.settings.segmentation == "movement":
            usable.append(cut_one(recorded, reference.onset, reference.controlled_onset))
        else:
            usable.append(recorded)
    examples = []
    found = make_examples(usable, reference.basis, reference.settings.ridge)
    for recorded, example in zip(usable, found, strict=True):
        if isinstance(example, TrainingError):
            total = _reject(total, recorded.name, str(example))
        else:
            examples.append((recorded, example))
    groups: dict[str, list[Example]] = {}
    for example in _with_aligned(examples, reference):
        groups.setdefault(example.task, []).append(example)
    return total._replace(
        tasks={label: summarize(group) for label, group in groups.items()},
        used=tuple(example.name for _, example in examples),
    )


def _with_aligned(
    examples: Sequence[tuple[Demonstration, Example]], reference: Reference
) -> list[Example]:
    """The examples, each with what it is over the reference phase of its task."""
    recordings = [recorded for recorded, _ in examples]
    aligned = make_examples(
        recordings,
        reference.forecast_basis,
        reference.settings.ridge,
        reference.timing.warps(recordings),
    )
    return [
        example._replace(aligned=over_reference)
        for (_, example), over_reference in zip(examples, aligned, strict=True)
    ]


def _reason_against(recorded: Demonstration, model: Demonstration | Reference | None) -> str:
    """Why a recording cannot be learned from together with those before it, or nothing."""
    if recorded.task is None:
        return "it has no label `task`"
    if recorded.task == NONE:
        return f"the label {NONE!r} is reserved"
    if model is None:
        return ""
    expected, found = _dofs(model), _dofs(recorded)
    if expected == found:
        return ""
    source = model.source if isinstance(model, Reference) else model.name
    return describe(
        "DOFs",
        f"those of {source or 'the model'}, {expected}",
        found,
        "Read all recordings with one DOF file.",
    )


def _dofs(model: Demonstration | Reference) -> tuple[tuple[SignalNames, ...], ...]:
    """Names and unit of each signal, observed and controlled."""
    if isinstance(model, Reference):
        return model.observed, model.controlled
    return _names(model.observed), _names(model.controlled)


def _names(signals: Sequence) -> tuple[SignalNames, ...]:
    return tuple(SignalNames(signal.names, signal.unit) for signal in signals)


def _reject(total: Accumulated, name: str, reason: str) -> Accumulated:
    return total._replace(
        rejected=(*total.rejected, (name, reason))[:NAMES_KEPT], n_rejected=total.n_rejected + 1
    )


def _demonstrations(recordings: Iterable[Demonstration]) -> Iterator[Demonstration]:
    """The recordings one by one; refuses anything else."""
    for number, recorded in enumerate(recordings if isinstance(recordings, Iterable) else [None]):
        if not isinstance(recorded, Demonstration):
            found = type(recordings if recorded is None else recorded).__name__
            cure = "Make them with `Demonstration.from_arrays` or `read_demonstrations`."
            place = f"demonstrations[{number}]"
            raise ArgumentError(describe(place, "a Demonstration in a list", found, cure))
        yield recorded


def _taken(reversed_head: list[Demonstration]) -> Iterator[Demonstration]:
    """The recordings of a reversed list, each let go when it is handed out."""
    while reversed_head:
        yield reversed_head.pop()


def _batches(recordings: Iterable[Demonstration], size: int) -> Iterator[list[Demonstration]]:
    batch = []
    for recorded in recordings:
        batch.append(recorded)
        if len(batch) == size:
            yield batch
            batch = []
    if batch:
        yield batch

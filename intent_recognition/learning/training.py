# SPDX-License-Identifier: Apache-2.0
"""From demonstrations to a `TaskLibrary`, all at once or one by one."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from intent_recognition.errors import TrainingError, describe
from intent_recognition.learning.accumulation import (
    NAMES_KEPT,
    Accumulated,
    Reference,
    accumulate,
    example_of,
)
from intent_recognition.learning.examples import Example, sample_phases, scored_phases
from intent_recognition.learning.fitting import (
    aligned_primitives,
    aligned_statistics,
    learned_from,
    library_from_statistics,
    recognition,
    scales,
)
from intent_recognition.learning.held_out_validation import (
    ALIGNED_NOISE_SCALES,
    ALIGNED_STRENGTHS,
    HeldOutValidation,
    validate_held_out,
)
from intent_recognition.learning.recognition_choice import (
    RECOGNITION_NOISE_SCALES,
    RECOGNITION_STRENGTHS,
    least_noise,
    recognition_losses,
)
from intent_recognition.learning.selection import Candidate, TaskSamples, select
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import (
    TaskStatistics,
    merge_statistics,
    pooled_moments,
    summarize,
)
from intent_recognition.learning.unknown_task_calibration import calibrate_none
from intent_recognition.promp import NormalizedRBFBasis, TaskLibrary, leave_one_out_targets
from intent_recognition.signals import Demonstration

MAX_SCORED = 600
"""Demonstrations of all tasks that hyperparameters are chosen on, at most."""
SCORED_TOGETHER = 16
"""Demonstrations left out at a time, which bounds the memory of their covariances."""


@dataclass(frozen=True)
class Trained:
    """A library with what it takes to add demonstrations to it.

    Attributes:
        library: the tasks.
        reference: how a recording becomes an example.
        tasks: statistics of each label, in the library's order.
        chosen: hyperparameters.
    """

    library: TaskLibrary
    reference: Reference
    tasks: Mapping[str, TaskStatistics]
    chosen: Candidate


class TrainingReport(NamedTuple):
    """What was learned, and what became of the demonstrations.

    Attributes:
        used: names of those learned from, of very many the first 1000.
        rejected: (name, reason) of those left out, of very many the first 1000.
        chosen: the hyperparameters taken.
        tried: all that were scored.
        n_used, n_rejected: how many in all.
        trained: the library with its statistics, to add demonstrations to.
    """

    used: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]
    chosen: Candidate
    tried: tuple[Candidate, ...]
    n_used: int
    n_rejected: int
    trained: Trained

    @property
    def library(self) -> TaskLibrary:
        """The learned tasks."""
        return self.trained.library


def learn(
    demonstrations: Iterable[Demonstration], settings: TrainingSettings | None = None
) -> TaskLibrary:
    """Learn one interaction primitive per task from labelled demonstrations.

    Regularisation, alignment in time and the calibration against unknown movements are chosen by
    cross-validation. Demonstrations that cannot be used (too short, other DOFs, no label) are left
    out; `learn_with_report` says which and why.

    Args:
        demonstrations: labelled recordings with the same DOFs: a list, or a stream of any length,
            of which a few are held at a time (see `accumulate`). A task may have a single
            demonstration as long as another has two.
        settings: how to learn; `TrainingSettings()` when None.

    Raises:
        ArgumentError: an item is not a `Demonstration`.
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    return learn_with_report(demonstrations, settings).library


def learn_with_report(
    demonstrations: Iterable[Demonstration],
    settings: TrainingSettings | None = None,
    provenance: Mapping[str, object] | None = None,
) -> TrainingReport:
    """Learn as `learn` does; the result also says what was used, left out and chosen.

    Args:
        demonstrations: as in `learn`.
        settings: as in `learn`.
        provenance: stored in the library, such as where the demonstrations come from.

    Raises:
        ArgumentError: an item is not a `Demonstration`.
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    return learn_accumulated(accumulate(demonstrations, settings or TrainingSettings()), provenance)


def learn_accumulated(
    accumulated: Accumulated, provenance: Mapping[str, object] | None = None
) -> TrainingReport:
    """Learn from sufficient statistics: choose the hyperparameters and build the library.

    Raises:
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    _check_enough(accumulated)
    chosen, tried = choose(accumulated.tasks, accumulated.reference)
    library = library_from_statistics(accumulated.tasks, accumulated.reference, chosen, provenance)
    library = _calibrated(library, accumulated.tasks, accumulated.reference, chosen)
    return TrainingReport(
        accumulated.used,
        accumulated.rejected,
        chosen,
        tried,
        accumulated.n_used,
        accumulated.n_rejected,
        Trained(library, accumulated.reference, accumulated.tasks, chosen),
    )


def choose(
    tasks: Mapping[str, TaskStatistics], reference: Reference
) -> tuple[Candidate, tuple[Candidate, ...]]:
    """Hyperparameters by leave-one-out prediction, and all that were tried.

    Every demonstration that was kept whole is left out in turn, of very many `MAX_SCORED`, as many
    of each task; the statistics it is predicted from are those of all others.
    """
    chosen, tried = _choose(tasks, reference.basis)
    chosen = _choose_recognition(tasks, reference, chosen)
    return _choose_aligned(tasks, reference, chosen), tried


def _choose_recognition(
    tasks: Mapping[str, TaskStatistics], reference: Reference, chosen: Candidate
) -> Candidate:
    """Hyperparameters of recognition, by the log loss of left-out demonstrations."""
    candidates = [
        chosen._replace(recognition_strength=strength, recognition_noise_scale=noise_scale)
        for noise_scale in RECOGNITION_NOISE_SCALES
        for strength in RECOGNITION_STRENGTHS
    ]
    library = library_from_statistics(tasks, reference, chosen)
    losses = []
    for candidate in candidates:
        strength = candidate.recognition_strength
        recognising = replace(
            library,
            recognition_covariance=recognition(tasks, reference, strength),
            recognition_noise_scale=candidate.recognition_noise_scale,
        )
        losses.append(recognition_losses(recognising, tasks, reference, strength))
    return candidates[least_noise(np.array(losses))]


def _choose_aligned(
    tasks: Mapping[str, TaskStatistics], reference: Reference, chosen: Candidate
) -> Candidate:
    """Hyperparameters of the aligned primitives, and whether predictions come from them.

    They do where left-out demonstrations are predicted with less error than at steady progress.
    """
    over_reference = aligned_statistics(tasks)
    if over_reference is None:
        return chosen
    steady = library_from_statistics(tasks, reference, chosen).primitives
    aligned = aligned_primitives(tasks, reference, chosen)
    floor, _ = scales(tasks)
    (least,) = validate_held_out([HeldOutValidation(steady, chosen.strength)], tasks, tasks, floor)
    tried = [
        HeldOutValidation(replace(aligned, noise_scale=noise_scale), strength)
        for strength in ALIGNED_STRENGTHS
        for noise_scale in ALIGNED_NOISE_SCALES
    ]
    floor, _ = scales(over_reference)
    errors = validate_held_out(tried, over_reference, tasks, floor)
    best = int(np.argmin(errors))
    if errors[best] < least:
        primitives, strength = tried[best]
        chosen = chosen._replace(
            aligned=True, aligned_strength=strength, aligned_noise_scale=primitives.noise_scale
        )
    return chosen


def _choose(
    tasks: Mapping[str, TaskStatistics], basis: NormalizedRBFBasis
) -> tuple[Candidate, tuple[Candidate, ...]]:
    """Hyperparameters of the primitives with this basis, and all that were tried."""
    most = MAX_SCORED
    if sum(len(task.examples) for task in tasks.values()) > MAX_SCORED:
        most = max(MAX_SCORED // len(tasks), 1)
    parts = [
        (task, task.examples[start : min(start + SCORED_TOGETHER, most)])
        for task in tasks.values()
        for start in range(0, min(len(task.examples), most), SCORED_TOGETHER)
    ]
    floor, noise = scales(tasks)
    return select(
        (_samples(task, examples, basis) for task, examples in parts),
        _targets(parts, tasks, floor),
        noise,
        basis.design_matrix(scored_phases()),
    )


def add_demonstration(trained: Trained, demonstration: Demonstration) -> Trained:
    """The same with one more labelled demonstration, of a known task or a new one.

    Equals training anew with the same reference and hyperparameters, which `choose_again`
    chooses again.
    Priors over tasks are kept; a new task takes its share of them.

    Raises:
        TrainingError: the demonstration cannot be used; says why.
    """
    example = example_of(demonstration, trained.reference)
    return add_statistics(trained, {example.task: summarize([example])}, [example.name])


def add_statistics(
    trained: Trained, tasks: Mapping[str, TaskStatistics], names: Sequence[str] = ()
) -> Trained:
    """The same with many more demonstrations, whose statistics were gathered by its reference.

    Args:
        trained: what to add to; it stays as it is.
        tasks: statistics of each label.
        names: of the demonstrations, for the provenance.
    """
    merged = dict(trained.tasks)
    for label, task in tasks.items():
        merged[label] = merge_statistics(merged[label], task) if label in merged else task
    merged = dict(sorted(merged.items()))
    before = trained.library
    provenance = dict(before.provenance)
    provenance["bags"] = [*provenance.get("bags", ()), *names][:NAMES_KEPT]
    library = replace(
        before,
        labels=tuple(merged),
        **learned_from(merged, trained.reference, trained.chosen),
        **_priors(before, tuple(merged)),
        provenance=provenance,
    )
    return Trained(library, trained.reference, merged, trained.chosen)


def choose_again(trained: Trained) -> tuple[Trained, tuple[Candidate, ...]]:
    """The same with hyperparameters chosen on all it has by now, and all that were tried."""
    chosen, tried = choose(trained.tasks, trained.reference)
    library = replace(
        trained.library,
        **learned_from(trained.tasks, trained.reference, chosen),
        provenance={**trained.library.provenance, "chosen": chosen._asdict()},
    )
    library = _calibrated(library, trained.tasks, trained.reference, chosen)
    return replace(trained, library=library, chosen=chosen), tried


def _calibrated(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    reference: Reference,
    chosen: Candidate,
) -> TaskLibrary:
    """The library with its evidence against none read as these demonstrations ask for."""
    strength = chosen.recognition_strength
    calibration = calibrate_none(library, tasks, reference, strength)
    return replace(library, none_calibration=calibration)


def _targets(
    parts: Iterable[tuple[TaskStatistics, Sequence[Example]]],
    tasks: Mapping[str, TaskStatistics],
    floor: np.ndarray,
) -> Iterator[np.ndarray]:
    """Target covariances without each demonstration in turn, part after part."""
    pooled = pooled_moments(tasks.values())
    for task, examples in parts:
        deviations = np.array([example.weights for example in examples]) - task.mean
        yield leave_one_out_targets(task.moments, pooled, deviations, floor)


def _samples(
    task: TaskStatistics, examples: Sequence[Example], basis: NormalizedRBFBasis
) -> TaskSamples:
    """What the hyperparameters are scored on, of some demonstrations of one task."""
    phase = np.repeat(sample_phases()[None], len(examples), axis=0)
    return TaskSamples(
        task.mean,
        task.moments,
        np.array([e.weights for e in examples]),
        np.array([e.observed for e in examples]),
        basis.design_matrix(phase),
        phase,
        np.array([e.controlled for e in examples]),
    )


def _priors(before: TaskLibrary, labels: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Priors over more tasks: what was learned among the known ones stays in proportion."""
    known = np.array([labels.index(label) for label in before.labels])
    n = len(labels)
    share = len(known) / n
    task_prior = np.full(n, 1.0 / n)
    task_prior[known] = before.task_prior * share
    transition_prior = np.full((n + 1, n), 1.0 / n)
    transition_prior[np.ix_([*known, n], known)] = before.transition_prior * share
    return {"task_prior": task_prior, "transition_prior": transition_prior}


def _check_enough(accumulated: Accumulated) -> None:
    """Refuse what no covariance can be learned from."""
    if not accumulated.tasks:
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two usable, labelled demonstrations of a task",
                f"none of {accumulated.n_rejected}"
                + "".join(f"; {name}: {reason}" for name, reason in accumulated.rejected[:3]),
                "Check the labels and the DOF file.",
            )
        )
    if accumulated.n_used == len(accumulated.tasks):
        raise TrainingError(
            describe(
                "demonstrations",
                "at least two demonstrations of one of the tasks",
                f"one of each of {len(accumulated.tasks)}",
                "Record more: 5 to 20 of each task are usual.",
            )
        )

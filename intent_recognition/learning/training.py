# SPDX-License-Identifier: Apache-2.0
"""Learning a `TaskLibrary` from demonstrations, all at once or one by one."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from intent_recognition.array_types import brief
from intent_recognition.errors import TrainingError, check_type
from intent_recognition.filtering import STOP_LEAD
from intent_recognition.learning.accumulation import NAMES_KEPT, Accumulated, accumulate
from intent_recognition.learning.fitting import (
    chosen_fields,
    learned_from,
    library_from_statistics,
    statistics_of,
)
from intent_recognition.learning.hyperparameters import Hyperparameters
from intent_recognition.learning.left_out import (
    LeavingOut,
    learn_left_out_odds,
    learn_switch_margin,
)
from intent_recognition.learning.preprocessing import (
    Preprocessing,
    example_of,
    other_units_of,
    slips_of,
)
from intent_recognition.learning.selection import Choice, choose
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.statistics import TaskStatistics, merge_tasks, summarize
from intent_recognition.learning.timing import PACES
from intent_recognition.learning.unknown_task import learn_none_margin
from intent_recognition.learning.unnamed_people import told_apart, with_people
from intent_recognition.promp import TaskLibrary, stack_tasks
from intent_recognition.signals import Demonstration, StreamFinding, label_doubts


@brief
@dataclass(frozen=True)
class Trained:
    """A library with the statistics that are needed to add demonstrations to it."""

    library: TaskLibrary
    preprocessing: Preprocessing  # how a recording becomes an example
    tasks: Mapping[str, TaskStatistics]  # statistics of each label, in the library's order
    chosen: Hyperparameters


@brief
class TrainingReport(NamedTuple):
    """The learned library, and which demonstrations were used and left out.

    Attributes:
        used: names of the demonstrations learned from, at most the first 1000.
        rejected: (name, reason) of the demonstrations left out, at most the first 1000.
        tried: all hyperparameters that were scored; empty if those of a model were kept.
        n_used, n_rejected: numbers of demonstrations used and left out.
        trained: the library with its statistics, to which demonstrations can be added.
        doubts: doubtful findings in the recordings, if these were checked.
    """

    used: tuple[str, ...]
    rejected: tuple[tuple[str, str], ...]
    chosen: Hyperparameters
    tried: tuple[Hyperparameters, ...]
    n_used: int
    n_rejected: int
    trained: Trained
    doubts: tuple[StreamFinding, ...] = ()

    @property
    def library(self) -> TaskLibrary:
        """The learned tasks."""
        return self.trained.library

    @property
    def doubtful(self) -> list[StreamFinding]:
        """The doubts, and recordings of rare tasks whose label may be misspelt."""
        tasks = self.trained.tasks.items()
        return [
            *self.doubts,
            *label_doubts((one.name, label) for label, task in tasks for one in task.examples),
        ]


def learn(
    demonstrations: Iterable[Demonstration], settings: TrainingSettings | None = None
) -> TaskLibrary:
    """Learn one interaction primitive per task from labelled demonstrations.

    Noise, alignment in time and the margin over unknown movements are chosen by
    cross-validation. Demonstrations that cannot be used (too short, other DOFs, no label) are left
    out with a warning; `learn_with_report` returns which and why instead. A demonstration that
    seems to have another unit, frame, order or label than the rest is used, with a warning.

    Args:
        demonstrations: labelled recordings with the same DOFs: a list, or a stream of any length,
            of which a few are held at a time (see `accumulate`). A task may have a single
            demonstration as long as another has two.
        settings: how to learn; `TrainingSettings()` when None.

    Raises:
        ArgumentError: an item is not a `Demonstration`.
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    report = learn_with_report(demonstrations, settings)
    if report.n_rejected:
        first = "; ".join(f"{name}: {reason}" for name, reason in report.rejected[:3])
        n = report.n_used + report.n_rejected
        warnings.warn(
            f"{report.n_rejected} of {n} demonstrations are left out: {first}", stacklevel=2
        )
    trained = report.trained
    odd = other_units_of(trained.tasks, trained.tasks, trained.preprocessing)
    odd = odd or slips_of(trained.tasks, trained.preprocessing)
    for finding in [*odd, *report.doubtful]:
        warnings.warn(str(finding), stacklevel=2)
    return report.library


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
    settings = TrainingSettings() if settings is None else settings
    check_type("settings", settings, TrainingSettings, "Pass `TrainingSettings(...)`, or None.")
    return learn_accumulated(accumulate(demonstrations, settings), provenance)


def learn_accumulated(
    accumulated: Accumulated, provenance: Mapping[str, object] | None = None
) -> TrainingReport:
    """Learn from sufficient statistics: choose the hyperparameters and build the library.

    Raises:
        TrainingError: nothing usable, or no task with at least two demonstrations.
    """
    preprocessing = _check_enough(accumulated)
    tasks = with_people(accumulated.tasks, preprocessing.n_observed)
    chosen, couplings, tried = choose_hyperparameters(tasks, preprocessing)
    library = library_from_statistics(tasks, preprocessing, chosen, provenance)
    library = replace(library, **couplings)
    trained = with_margins(Trained(library, preprocessing, tasks, chosen))
    return TrainingReport(
        accumulated.used,
        accumulated.rejected,
        chosen,
        tried,
        accumulated.n_used,
        accumulated.n_rejected,
        trained,
    )


def choose_hyperparameters(
    tasks: Mapping[str, TaskStatistics], preprocessing: Preprocessing
) -> Choice:
    """Choose hyperparameters by held-out validation; also return all that were tried."""
    paces = PACES if all(task.aligned is not None for task in tasks.values()) else PACES[:-1]
    candidates = {}
    for pace in paces:
        parameters = Hyperparameters(pace)
        library = library_from_statistics(tasks, preprocessing, parameters)
        candidates[pace] = library, statistics_of(tasks, parameters.aligned)
    return choose(candidates, tasks)


def add_demonstration(trained: Trained, demonstration: Demonstration) -> Trained:
    """Add one labelled demonstration, of a known task or a new one.

    The primitives equal those learned anew with the same preprocessing and hyperparameters. Margins
    and couplings are kept; `choose_again` learns them again. Priors over tasks are kept, and a new
    task takes its share of them.

    Raises:
        TrainingError: the demonstration cannot be used, or is in another unit.
    """
    example = example_of(demonstration, trained.preprocessing)
    return add_statistics(trained, {example.task: summarize([example])}, [example.name])


def add_statistics(
    trained: Trained, tasks: Mapping[str, TaskStatistics], names: Sequence[str] = ()
) -> Trained:
    """Add demonstrations in a copy, from statistics made with the same preprocessing.

    Their names are added to the provenance.

    Raises:
        ArgumentError: their examples are not aligned, and the library's primitives are.
        TrainingError: one of them is in another unit than those learned before.
    """
    for finding in other_units_of(tasks, trained.tasks, trained.preprocessing):
        raise TrainingError(f"{finding} Correct it, or leave it out.")
    merged = merge_tasks(trained.tasks, tasks)
    if told_apart(trained.tasks):
        merged = with_people(merged, trained.preprocessing.n_observed)
    before = trained.library
    bags = before.provenance.get("bags")
    known_bags = bags if isinstance(bags, (list, tuple)) else ()
    library = replace(
        before,
        labels=tuple(merged),
        **learned_from(merged, trained.preprocessing, trained.chosen),
        **_priors(before, tuple(merged)),
        **_couplings(before, tuple(merged)),
        provenance={**before.provenance, "bags": [*known_bags, *names][:NAMES_KEPT]},
    )
    return Trained(library, trained.preprocessing, merged, trained.chosen)


def choose_again(trained: Trained) -> tuple[Trained, tuple[Hyperparameters, ...]]:
    """Choose hyperparameters and learn margins again; also return all that were tried."""
    tasks = with_people(trained.tasks, trained.preprocessing.n_observed)
    chosen, couplings, tried = choose_hyperparameters(tasks, trained.preprocessing)
    library = replace(
        trained.library,
        **couplings,
        **chosen_fields(trained.preprocessing, chosen),
        **learned_from(tasks, trained.preprocessing, chosen),
        provenance={**trained.library.provenance, "chosen": chosen._asdict()},
    )
    return with_margins(replace(trained, library=library, tasks=tasks, chosen=chosen)), tried


def with_margins(trained: Trained) -> Trained:
    """Learn margins and the risk of acting from the demonstrations, in a copy."""
    tasks = statistics_of(trained.tasks, trained.chosen.aligned)
    leave_out = partial(LeavingOut, tasks=tasks, strength=trained.chosen.shared_strength)
    of_none = partial(learn_none_margin, leave_out(trained.library), trained.tasks)
    library = replace(trained.library, none_margin=of_none())
    if trained.preprocessing.settings.switching:
        library = replace(library, stop_margin=of_none(since=STOP_LEAD))
        margin = learn_switch_margin(leave_out(library), trained.tasks)
        library = replace(library, switch_margin=margin)
        odds = learn_left_out_odds(leave_out(library), trained.tasks)
        library = replace(library, left_out_odds=odds)
    return replace(trained, library=library)


def _priors(before: TaskLibrary, labels: tuple[str, ...]) -> dict[str, Any]:
    """Priors over more tasks: the known ones keep their proportions."""
    known = np.array([labels.index(label) for label in before.labels])
    n = len(labels)
    share = len(known) / n
    task_prior = np.full(n, 1.0 / n)
    task_prior[known] = before.task_prior * share
    transition_prior = np.full((n + 1, n), 1.0 / n)
    transition_prior[np.ix_(np.append(known, n), known)] = before.transition_prior * share
    return {"task_prior": task_prior, "transition_prior": transition_prior}


def _couplings(before: TaskLibrary, labels: tuple[str, ...]) -> dict[str, Any]:
    """Extend couplings to more tasks; the new ones have none."""
    found = {}
    for name in ("coupling", "pose_regression"):
        learned = getattr(before, name)
        if learned is not None:
            of_tasks = zip(before.labels, *learned, strict=True)
            parts = {labels.index(label): own for label, *own in of_tasks}
            learned = type(learned)(*stack_tasks(learned._fields, parts, len(labels)))
        found[name] = learned
    return found


def _check_enough(accumulated: Accumulated) -> Preprocessing:
    """Return the preprocessing, or raise if no covariance can be learned."""
    reasons = "".join(f"; {name}: {reason}" for name, reason in accumulated.rejected[:3])
    if accumulated.preprocessing is None or not accumulated.tasks:
        raise TrainingError.about(
            "demonstrations",
            "at least two usable, labelled demonstrations of a task",
            f"none of {accumulated.n_rejected}{reasons}",
            "Check the DOFs and the labels; without labels, use learn_mixture or --unlabelled."
            if accumulated.n_rejected
            else "Check where they were read from.",
        )
    if accumulated.n_used == len(accumulated.tasks):
        expected = "at least two demonstrations of a task"
        got = f"one of {', '.join(accumulated.tasks)}{reasons}"
        cure = "Record more: 5 to 20 of each task are usual."
        raise TrainingError.about("demonstrations", expected, got, cure)
    return accumulated.preprocessing

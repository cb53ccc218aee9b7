# SPDX-License-Identifier: Apache-2.0
"""Learn tasks from demonstrations without labels: each component of a mixture is a task."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from intent_recognition.errors import TrainingError
from intent_recognition.learning.components import (
    ComponentChoice,
    choose_components,
    purity,
    try_components,
)
from intent_recognition.learning.examples import TrainingExample
from intent_recognition.learning.mixture import BASIS, RIDGE, mixture_features
from intent_recognition.learning.preprocessing import examples_together
from intent_recognition.learning.settings import TrainingSettings
from intent_recognition.learning.training import TrainingReport, learn_with_report
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, numbered


class Relabelled(NamedTuple):
    """Demonstrations with their components as labels."""

    # the same recordings with `task` set to `component_1` (the largest) and so on
    demonstrations: tuple[Demonstration, ...]
    rejected: tuple[tuple[str, str], ...]  # (name, reason) of each recording left out
    choice: ComponentChoice  # number of components, and all numbers that were tried
    # agreement with existing labels; None if no recording had a label
    purity: float | None


def learn_mixture(
    demonstrations: Sequence[Demonstration],
    n_components: int | None = None,
    settings: TrainingSettings | None = None,
    rng: np.random.Generator | None = None,
) -> TaskLibrary:
    """Learn a mixture of interaction primitives from unlabelled demonstrations.

    Each component becomes a task, `component_1` the largest (Ewerton et al. 2015). Labels are
    ignored.

    Args:
        demonstrations: recordings with the same DOFs.
        n_components: number of tasks; None to choose it by left-out prediction.
        settings: how to learn; `TrainingSettings()` when None.
        rng: draws the starts of EM; a generator seeded with 0 when None.

    Raises:
        TrainingError: no recording can be used, or no component has two of them.
        ArgumentError: more components than recordings.
    """
    settings, rng = settings or TrainingSettings(), rng or np.random.default_rng(0)
    found = label_by_components(demonstrations, settings, rng, n_components=n_components)
    return learn_components(found, settings).library


def label_by_components(
    demonstrations: Sequence[Demonstration],
    settings: TrainingSettings,
    rng: np.random.Generator,
    *,
    n_components: int | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> Relabelled:
    """Label demonstrations by mixture components; existing labels only give the purity.

    Args:
        demonstrations: recordings with the same DOFs.
        settings: provides the segmentation; the mixture has its own basis and ridge.
        rng: draws the starts of EM.
        n_components: number of components; None to choose it by left-out prediction.
        progress: called with each number of components tried.

    Raises:
        TrainingError: no recording can be used.
        ArgumentError: more components than recordings.
    """
    used, examples, rejected = _examples(demonstrations, settings)
    first = used[0]
    features = mixture_features(
        np.array([example.weights for example in examples]),
        sum(len(signal.names) for signal in first.observed),
        BASIS,
    )
    if n_components is None:
        choice = choose_components(features, rng, progress=progress)
    else:
        tried = try_components(features, n_components, rng)
        choice = ComponentChoice(tried, (tried,))
    labels = choice.chosen.labels
    known = np.array([recorded.task is not None for recorded in used])
    names = [recorded.task for recorded in used if recorded.task is not None]
    return Relabelled(
        tuple(
            replace(recorded, task=f"component_{label + 1}")
            for recorded, label in zip(used, labels, strict=True)
        ),
        rejected,
        choice,
        purity(names, labels[known]) if names else None,
    )


def learn_components(
    found: Relabelled,
    settings: TrainingSettings | None = None,
    provenance: Mapping[str, object] | None = None,
) -> TrainingReport:
    """Learn each component as a task, with p(k) = n_k / n throughout (Ewerton et al. 2015, Eq. 8).

    Raises:
        TrainingError: no component has at least two usable demonstrations.
    """
    trained = (report := learn_with_report(found.demonstrations, settings, provenance)).trained
    library = trained.library
    share = library.n_demonstrations / np.sum(library.n_demonstrations)
    library = replace(
        library, task_prior=share, transition_prior=np.tile(share, (library.n_tasks + 1, 1))
    )
    return report._replace(trained=replace(trained, library=library))


def _examples(
    demonstrations: Sequence[Demonstration], settings: TrainingSettings
) -> tuple[list[Demonstration], list[TrainingExample], tuple[tuple[str, str], ...]]:
    """The usable recordings, their examples, and why others are left out."""
    demonstrations = [*numbered(demonstrations)]
    stand_ins = [replace(recorded, task="unlabelled") for recorded in demonstrations]
    own = replace(settings, n_basis=BASIS.n_basis, width=BASIS.width, ridge=RIDGE)
    used, examples, rejected = [], [], []
    for recorded, example in zip(demonstrations, examples_together(stand_ins, own), strict=True):
        if isinstance(example, TrainingError):
            rejected.append((recorded.name, str(example)))
        else:
            used.append(recorded)
            examples.append(example)
    if not used:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in rejected[:3]) or "none"
        expected, cure = "at least one usable recording", "Check the recordings and the DOF file."
        raise TrainingError.about("demonstrations", expected, reasons, cure)
    return used, examples, tuple(rejected)

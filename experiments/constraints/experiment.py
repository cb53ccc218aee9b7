# SPDX-License-Identifier: Apache-2.0
"""Task constraints that carry over to other containers (Brandl et al. 2014, Fig. 3).

A classifier learns from 50 trials with one object when it pours, and when all that it pours ends
up in the second container; it is tested on the object's other trials and on nine other objects.
"""

from pathlib import Path

from experiments.constraints.features import (
    DIFFERENCE,
    LABEL,
    METHODS,
    STANDARD,
    THROW,
    THROW_STANDARD,
    THROW_UPRIGHT,
    UPRIGHT,
    filling_samples,
    know_all,
    pouring_samples,
)
from experiments.constraints.report import blocks, conditions, findings, numbers
from experiments.constraints.study import ConstraintScores, score
from experiments.constraints.trials import FILLING, POURING
from experiments.constraints.trials_file import TRIALS_FILE, read_trials
from experiments.results import ExperimentResult
from experiments.settings import Settings
from intent_recognition.share import share_path
from sim_bridge.containers import CONTAINER_NAMES
from sim_bridge.scenarios.pouring import annotated_source

SETS_PER_OBJECT = 10
"""Training sets drawn for each object, over which scores are averaged. Convention."""


def run(settings: Settings) -> ExperimentResult:
    """Score three kinds of features in both experiments."""
    path = share_path(TRIALS_FILE) if settings.bags is None else settings.bags / Path(TRIALS_FILE)
    trials = read_trials(path)
    settings.progress(0.0, "warping the mug onto the other containers")
    known = know_all(annotated_source(), settings.rng(1), range(len(CONTAINER_NAMES)))
    sheets = {
        POURING: {method: pouring_samples(trials, known[method]) for method in METHODS},
        FILLING: {method: filling_samples(trials, known[method]) for method in METHODS},
    }
    sheets[POURING][DIFFERENCE] = pouring_samples(trials, known[LABEL], difference=True)
    sheets[FILLING][THROW] = filling_samples(trials, known[LABEL], throw=True)
    for upright, name, thrown in (
        (False, STANDARD, THROW_STANDARD),
        (True, UPRIGHT, THROW_UPRIGHT),
    ):
        sheets[FILLING][name] = filling_samples(trials, known[STANDARD], upright=upright)
        sheets[FILLING][thrown] = filling_samples(
            trials, known[STANDARD], upright=upright, throw=True
        )
    n_sets = 1 if settings.quick else SETS_PER_OBJECT
    scores: dict[str, dict[str, dict[str, ConstraintScores]]] = {POURING: {}, FILLING: {}}
    todo = [(name, method) for name, sheet in sheets.items() for method in sheet]
    for done, (name, method) in enumerate(todo):
        settings.progress(0.2 + 0.8 * done / len(todo), f"{name}, {method}")
        # The same training sets for every method.
        stream = 2 if name == POURING else 3
        scores[name][method] = score(sheets[name][method], n_sets, settings.rng(stream))
    settings.progress(1.0, "figure")
    return ExperimentResult(
        title="Task constraints that carry over to other containers",
        source="Brandl et al. 2014, Fig. 3",
        question=(
            "What 50 trials with one cup tell of when it pours, and of when all of it ends up in"
            " the second container: does it hold for nine other cups and bowls?"
        ),
        findings=findings(trials, scores),
        blocks=blocks(scores),
        conditions=conditions(trials),
        numbers=numbers(trials, scores),
    )

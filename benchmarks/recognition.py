# SPDX-License-Identifier: Apache-2.0
"""Does `none` hold its ground on the shipped bags? The numbers of `intent evaluate`."""

from collections.abc import Iterator, Sequence

from benchmarks.measure import Result, at_least, at_most
from intent_recognition.evaluation import evaluate, make_folds
from intent_recognition.learning import TrainingSettings
from intent_recognition.signals import Demonstration

PROTOCOL = "kfold:3"
LET_PASS = 5.0
"""Share of unknown movements that a decision lets pass [%], as it is learned to."""


def unknown_tasks(demonstrations: Sequence[Demonstration]) -> Iterator[Result]:
    """Area of known against unknown movements, activations, and what none costs known tasks."""
    folds = make_folds(demonstrations, PROTOCOL)
    settings = TrainingSettings(segmentation="movement")
    none = evaluate(demonstrations, folds, settings, unknown_tasks=True)["none"]
    of = f"{none['n_known']} known and {none['n_unknown']} unknown movements, {PROTOCOL}"
    yield at_least("each task left out, area under the ROC", none["area"], 0.95, "", of)
    yield at_most(
        "unknown movements that activate a task",
        100 * none["activated_unknown"],
        LET_PASS,
        "%",
        f"{none['activated_known']:.1%} of the known ones",
    )
    lost = [
        both["without_none"] - both["with_none"]
        for table in none["accuracy"].values()
        for both in table.values()
    ]
    yield at_most(
        "accuracy that none costs known tasks, at worst",
        100 * max(lost),
        2.0,
        "points",
        f"of both kinds of phase and all shares observed; {100 * sum(lost) / len(lost):.2g} in the"
        f" mean; one movement is {100 / none['n_known']:.2g}",
    )

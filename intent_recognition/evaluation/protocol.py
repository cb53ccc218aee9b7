# SPDX-License-Identifier: Apache-2.0
"""Cross-validation of recognition and prediction on recordings left out of training."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from intent_recognition.errors import ArgumentError, describe
from intent_recognition.evaluation.scoring import (
    PHASES,
    PREDICTION_FRACTIONS,
    PREDICTION_NAMES,
    RECOGNITION_FRACTIONS,
    EvaluationRecords,
    collect,
    score_demonstration,
)
from intent_recognition.evaluation.unknown_movements import compare, follow_unknown
from intent_recognition.learning import TrainingSettings, cut_to_movement, learn
from intent_recognition.signals import Demonstration

Fold = tuple[list[int], list[int]]


def make_folds(n: int, protocol: str) -> list[Fold]:
    """Indices to train and to test on.

    Args:
        n: number of demonstrations.
        protocol: "loo" leaves one out at a time; "kfold:K" makes K folds, by index modulo K.

    Raises:
        ArgumentError: an unknown protocol, or more folds than recordings.
    """
    name, _, argument = protocol.partition(":")
    if name == "loo" and not argument:
        k = n
    elif name == "kfold" and argument.isdigit() and int(argument) >= 2:
        k = int(argument)
    else:
        raise ArgumentError(
            describe("protocol", "loo, kfold:K or holdout:FOLDER", protocol, "Choose one of these.")
        )
    if n < 2 or k > n:
        raise ArgumentError(
            describe("protocol", f"at least {max(k, 2)} recordings", n, "Record more, or lower K.")
        )
    return [([i for i in range(n) if i % k != f], list(range(f, n, k))) for f in range(k)]


def evaluate(
    demonstrations: Sequence[Demonstration],
    protocol: str | Sequence[Fold] = "loo",
    settings: TrainingSettings | None = None,
    *,
    start_posture: bool = False,
    both_starts: bool = False,
    unknown_tasks: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> dict:
    """Cross-validate recognition and prediction; the content of `intent evaluate --json`.

    Args:
        demonstrations: labelled recordings with the same DOFs.
        protocol: "loo" (leave one out), "kfold:K", or pairs of the indices to train and to test on.
        settings: how to learn; `TrainingSettings()` when None.
        start_posture: condition predictions on the controlled agent's position at the start.
        both_starts: also predict with the start posture, under `prediction_with_start_posture`.
        unknown_tasks: also leave out every task in turn and score its movements as unknown.
        progress: called with the number of demonstrations scored so far.

    Returns:
        Numbers by name, as docs/evaluation.md defines them: `recognition` and `prediction` by
        phase knowledge and share of the movement observed, `reliability`, `coverage`, `confusion`
        and `none`.

    Raises:
        ArgumentError: an unknown protocol, or more folds than demonstrations.
        TrainingError: a fold cannot be learned from.
    """
    folds = make_folds(len(demonstrations), protocol) if isinstance(protocol, str) else protocol
    settings = settings or TrainingSettings()
    if settings.segmentation == "movement":
        demonstrations = cut_to_movement(demonstrations)
        settings = replace(settings, segmentation="recording")
    collected = collect(both_starts)
    done, labels = 0, set[str]()
    units: tuple[str, ...] = ()
    for train, test in folds:
        training = [demonstrations[i] for i in train]
        library = learn(training, settings)
        units = tuple(dict.fromkeys(library.controlled_units))
        labels |= set(library.labels)
        for index in test:
            if demonstrations[index].task in library.labels:
                score_demonstration(
                    collected, library, training, demonstrations[index], start_posture
                )
            else:
                _miss(collected)
            done += 1
            progress(done)
    scored = sorted({index for train, test in folds for index in (*train, *test)})
    unknown = []
    if unknown_tasks:
        unknown = follow_unknown(
            [demonstrations[i] for i in scored], settings, lambda n: progress(done + n)
        )
    return {
        "n_demonstrations": done,
        "tasks": sorted(labels),
        "unit": units[0] if len(units) == 1 else list(units),
        **_tables(collected, units),
        "none": {
            **compare(collected.outcomes, unknown),
            "accuracy": collected.recognitions.accuracy_beside_none(),
        },
    }


def _miss(collected: EvaluationRecords) -> None:
    """Score a recording whose task could not be learned without it as not recognised."""
    for phase in PHASES:
        for fraction in RECOGNITION_FRACTIONS:
            collected.scores.add(phase, fraction, accuracy=0.0, log_loss=-np.log(1e-12))


def _tables(collected: EvaluationRecords, units: Sequence[str]) -> dict[str, object]:
    """Means over the recordings, and calibration."""
    scores, again = collected.scores, collected.with_start
    content: dict[str, object] = {
        "recognition": {
            phase: scores.table(phase, RECOGNITION_FRACTIONS, units, ("accuracy", "log_loss"))
            for phase in PHASES
        },
        "prediction": {
            phase: scores.table(phase, PREDICTION_FRACTIONS, units, PREDICTION_NAMES)
            for phase in PHASES
        },
    }
    if again is not None:
        content["prediction_with_start_posture"] = {
            phase: again.table(phase, PREDICTION_FRACTIONS, units, PREDICTION_NAMES)
            for phase in PHASES
        }
    content["reliability"] = collected.recognitions.reliability()
    content["coverage"] = collected.normalised_errors.table()
    content["confusion"] = collected.recognitions.confusion()
    return content

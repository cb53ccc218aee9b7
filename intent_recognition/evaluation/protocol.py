# SPDX-License-Identifier: Apache-2.0
"""Cross-validation of recognition and prediction on held-out recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import log

from intent_recognition.errors import ArgumentError, TrainingError, check_type, first_of
from intent_recognition.evaluation.folds import Fold, check_folds, make_folds, of_learned_tasks
from intent_recognition.evaluation.online import score_online, where_both_were_recorded
from intent_recognition.evaluation.reactive import HORIZONS_S, REACTIVE_NAMES, NearestWindows
from intent_recognition.evaluation.scoring import (
    PHASES,
    PREDICTION_FRACTIONS,
    PREDICTION_NAMES,
    RECOGNITION_FRACTIONS,
    EvaluationRecords,
    score_demonstration,
)
from intent_recognition.evaluation.unknown_movements import compare, follow_unknown
from intent_recognition.learning import (
    TrainingSettings,
    angle_references,
    cut_to_movement,
    examples_together,
    in_turns,
    learn_with_report,
)
from intent_recognition.signals import (
    Demonstration,
    StreamFinding,
    label_doubts,
    numbered,
    stream_defect,
    stream_doubts,
    summarise,
)

SEGMENTS = {
    "recording": "Shares observed are of the recording, with any rest before the movement;"
    " --segment movement gives shares of the movement, as at the online decision.",
    "movement": "Shares observed are of the movement, as at the online decision.",
}
CHANCE = (
    "Chance, which knows the number of tasks alone, has an accuracy of {share:.2f} and a log loss"
    " of {loss:.2f}. Early figures can be worse: where tasks begin alike, the recording that is"
    " left out is missing from its own task alone, whose mean is then farther from it than others."
)
ONE_TASK = "With one task there is nothing to recognise: its accuracy and log loss say nothing."


def evaluate(
    demonstrations: Sequence[Demonstration],
    protocol: str | Sequence[Fold] = "loo",
    settings: TrainingSettings | None = None,
    *,
    start_posture: bool = False,
    unknown_tasks: bool = False,
    online: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> dict:
    """Cross-validate recognition and prediction; the content of `intent evaluate --json`.

    Args:
        demonstrations: labelled recordings with the same DOFs.
        protocol: see `make_folds`; or a list of pairs of training and test indices.
        settings: settings of learning; `TrainingSettings()` when None.
        start_posture: condition predictions on the controlled agent's position at the start.
        unknown_tasks: also leave out every task in turn and score its movements as unknown.
        online: also simulate what the nodes would have done, see `score_online`.
        progress: called with the number of runs so far; each demonstration takes one run, and one
            more for each of `unknown_tasks` and `online`.

    Returns:
        Numbers by name, defined in docs/recognition.md: `recognition` and `prediction` by kind of
        phase and observed share, `reactive` by task and horizon, `segment` ("movement" or
        "recording", of which the share is meant), `reliability`, `coverage`, `confusion` and
        `none`; recordings that are `mistaken` for another task, and recordings `left_out` or
        `doubtful`, each with the reason.

    Raises:
        ArgumentError: an item is not a `Demonstration`, the protocol is unknown, an index is out of
            range, or there are too few demonstrations.
        TrainingError: a fold cannot be learned from.
    """
    settings = TrainingSettings() if settings is None else settings
    check_type("settings", settings, TrainingSettings, "Pass `TrainingSettings(...)`, or None.")
    demonstrations = [*numbered(demonstrations)]
    left_out = defects(demonstrations, settings)
    kept = [index for index in range(len(demonstrations)) if index not in left_out]
    usable = [demonstrations[index] for index in kept]
    if isinstance(protocol, str):
        folds = make_folds(usable, protocol)
    else:
        folds = _only(kept, check_folds(protocol, len(demonstrations)))
    tested = {index for _, test in folds for index in test}
    folds = of_learned_tasks(folds, usable)
    for index in sorted(tested - {index for _, test in folds for index in test}):
        reason = f"no recording of {usable[index].task} is left to learn from"
        left_out[kept[index]] = StreamFinding(usable[index].name, reason)
    if not folds:
        reasons = "; ".join(map(str, [*left_out.values()][:3])) or "none"
        expected, cure = "recordings to train and to test on", "See docs/recognition.md."
        raise ArgumentError.about("demonstrations", expected, reasons, cure)
    doubts = stream_doubts([*map(summarise, usable)])
    doubts += label_doubts((recorded.name, recorded.task) for recorded in usable)
    angles = angle_references(usable)
    usable = [in_turns(recorded, angles) for recorded in usable]
    recordings, segment = usable, settings.segmentation
    if segment == "movement":
        usable = cut_to_movement(usable)
        settings = replace(settings, segmentation="recording")
    usable = [where_both_were_recorded(recorded) for recorded in usable]
    collected = EvaluationRecords()
    done, labels = 0, set[str]()
    units: tuple[str, ...] = ()
    for train, test in folds:
        training = [usable[i] for i in train]
        try:
            library = learn_with_report(training, replace(settings, switching=False)).library
        except TrainingError as error:
            names = first_of([usable[i].name for i in test])
            raise TrainingError(f"learning without {names}: {error}") from error
        units = tuple(dict.fromkeys(library.controlled_units))
        labels |= set(library.labels)
        windows = NearestWindows(training)
        for recorded in (usable[i] for i in test):
            score_demonstration(collected, library, training, recorded, start_posture, windows)
            done += 1
            progress(done)
    scored = sorted({index for train, test in folds for index in (*train, *test)})
    unknown = []
    if unknown_tasks:
        shown = [usable[i] for i in scored]
        unknown = follow_unknown(shown, settings, lambda n: progress(done + n))
    decided = {}
    if online:
        runs = done + len(unknown)
        decided["online"] = score_online(recordings, folds, settings, lambda n: progress(runs + n))
    none = compare(collected.outcomes, unknown)
    return {
        "n_demonstrations": done,
        "tasks": sorted(labels),
        "unit": units[0] if len(units) == 1 else list(units),
        "segment": segment,
        "left_out": [{"recording": r.name, "reason": r.reason} for r in left_out.values()],
        "doubtful": [{"recording": d.name, "reason": d.reason} for d in doubts],
        **_tables(collected, units),
        "reactive": {
            label: collected.reactive.table(label, HORIZONS_S, units, REACTIVE_NAMES)
            for label in sorted(labels)
        },
        **decided,
        "none": none | {"accuracy": collected.recognitions.accuracy_beside_none()},
    }


def defects(
    demonstrations: Sequence[Demonstration], settings: TrainingSettings
) -> dict[int, StreamFinding]:
    """Reasons why recordings can be neither learned from nor scored, by index."""
    reasons = [stream_defect(recorded) for recorded in demonstrations]
    sound = [index for index, reason in enumerate(reasons) if not reason]
    examples = examples_together([demonstrations[index] for index in sound], settings)
    for index, example in zip(sound, examples, strict=True):
        if isinstance(example, TrainingError):
            reasons[index] = str(example)
    return {
        index: StreamFinding(demonstrations[index].name, reason)
        for index, reason in enumerate(reasons)
        if reason
    }


def _only(kept: Sequence[int], folds: Sequence[Fold]) -> list[Fold]:
    """The folds restricted to kept recordings, as positions among these, without empty tests."""
    place = {index: position for position, index in enumerate(kept)}
    both = [[[place[i] for i in part if i in place] for part in fold] for fold in folds]
    return [(train, test) for train, test in both if train and test]


def _tables(collected: EvaluationRecords, units: Sequence[str]) -> dict[str, object]:
    """Means over the recordings, and calibration."""
    scores = collected.scores

    def by_phase(fractions: Sequence[float], names: Sequence[str]) -> dict:
        return {phase: scores.table(phase, fractions, units, names) for phase in PHASES}

    return {
        "recognition": by_phase(RECOGNITION_FRACTIONS, ("accuracy", "log_loss")),
        "prediction": by_phase(PREDICTION_FRACTIONS, PREDICTION_NAMES),
        "reliability": collected.recognitions.reliability(),
        "coverage": collected.normalised_errors.table(),
        "confusion": collected.recognitions.confusion(),
        "mistaken": collected.recognitions.mistaken,
    }


def remarks_on(result: Mapping) -> list[str]:
    """Remarks to print with the tables of `evaluate`: the meaning of shares, and limitations."""
    lines = [SEGMENTS[result.get("segment", "movement")]]
    n_tasks = len(result.get("tasks", ()))
    if n_tasks < 2:
        return [*lines, ONE_TASK] if n_tasks else lines
    return [*lines, CHANCE.format(share=1.0 / n_tasks, loss=log(n_tasks))]

# SPDX-License-Identifier: Apache-2.0
"""Scores of one held-out recording."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.evaluation.calibration import NormalisedErrors, RecognitionRecords
from intent_recognition.evaluation.reactive import MOMENTS, NearestWindows, score_reactive
from intent_recognition.evaluation.scores import (
    ScoreTable,
    mean_of_task,
    nearest_neighbour,
    per_unit,
    sample,
)
from intent_recognition.evaluation.unknown_movements import (
    DecisionMonitor,
    MovementOutcome,
    in_context,
)
from intent_recognition.filtering import (
    MovementFilter,
    PriorGrid,
    TaskPosterior,
    fixed_prior_grid,
    make_prior_grid,
    task_posterior,
)
from intent_recognition.learning import FRACTIONS as PREDICTION_FRACTIONS
from intent_recognition.learning import in_turns
from intent_recognition.promp import StartPosture, TaskLibrary, angle_starts
from intent_recognition.signals import Demonstration, merge

RECOGNITION_FRACTIONS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
"""Shares of the movement, or of the recording, at which recognition is scored."""
TRUTH_PHASES = np.linspace(0.0, 1.0, 100)
PHASES = ("known_phase", "unknown_phase")
PREDICTION_NAMES = (
    "rmse",
    "rmse_inferred_task",
    "rmse_future",
    "rmse_mean_of_task",
    "rmse_nearest_neighbour",
    "end_rmse",
    "coverage_2_sigma",
    "nll",
)


@dataclass
class EvaluationRecords:
    """Results collected over all held-out recordings.

    Attributes:
        scores: means by kind of phase, observed share and name.
        recognitions: recognised and true tasks.
        normalised_errors: errors in predicted standard deviations.
        outcomes: decision about each movement of unknown duration.
        reactive: squared errors of reactive predictions, by task and horizon.
    """

    scores: ScoreTable = field(default_factory=ScoreTable)
    recognitions: RecognitionRecords = field(default_factory=RecognitionRecords)
    normalised_errors: NormalisedErrors = field(default_factory=NormalisedErrors)
    outcomes: list[MovementOutcome] = field(default_factory=list)
    reactive: ScoreTable = field(default_factory=ScoreTable)


def score_demonstration(
    collected: EvaluationRecords,
    library: TaskLibrary,
    training: Sequence[Demonstration],
    test: Demonstration,
    start_posture: bool,
    windows: NearestWindows,
) -> None:
    """Add the scores of one held-out demonstration.

    Args:
        collected: results to which the scores are added.
        library: tasks learned without this demonstration.
        training: demonstrations from which the library was learned.
        test: held-out demonstration.
        start_posture: whether predictions know the controlled agent's start.
        windows: baseline of reactive prediction.
    """
    duration, test = test.duration_s, in_turns(test, angle_starts(library))
    times = TRUTH_PHASES * duration
    truth = sample(test.controlled, test.start_ns, times)
    learned, library = library, in_context(library, test)
    posture = StartPosture(truth[0], np.zeros(library.n_controlled))
    label = library.labels.index(str(test.task))
    for phase in PHASES:
        known = phase == "known_phase"
        hypotheses = fixed_prior_grid(library, duration) if known else make_prior_grid(library)
        monitor = None if known else DecisionMonitor(learned)
        moments = () if known else MOMENTS
        shares = sorted({*RECOGNITION_FRACTIONS, *PREDICTION_FRACTIONS, *moments})
        for fraction, run in _snapshots(library, hypotheses, test, shares, monitor):
            posterior = task_posterior(run.log_evidence, hypotheses, fraction * duration)
            probabilities = _without_none(posterior, hypotheses)
            if fraction in moments:
                now = run, probabilities, test, fraction * duration
                score_reactive(collected.reactive, *now, posture, windows)
            if fraction in RECOGNITION_FRACTIONS:
                _score_recognition(
                    collected, phase, fraction, test, library, posterior, probabilities
                )
            if fraction in PREDICTION_FRACTIONS:
                start = posture if start_posture else None
                mean, std = run.mixture_at(times, np.eye(library.n_tasks)[label], start)
                inferred, _ = run.mixture_at(times, probabilities, start)
                own, errors = _prediction_scores(library, mean - truth, std, fraction)
                own["rmse_inferred_task"] = np.sqrt(per_unit(library, (inferred - truth) ** 2))
                baselines = _baseline_scores(library, training, test, fraction, truth, known)
                collected.scores.add(phase, fraction, **own, **baselines)
                collected.normalised_errors.add(phase, errors)
        if monitor is not None:
            collected.outcomes.append(monitor.outcome(str(test.task)))


def _score_recognition(
    collected: EvaluationRecords,
    phase: str,
    fraction: float,
    test: Demonstration,
    library: TaskLibrary,
    posterior: TaskPosterior,
    probabilities: Floats,
) -> None:
    """Add the recognised task; the probabilities (K,) are those without none."""
    task = str(test.task)
    own = probabilities[library.labels.index(task)]
    collected.scores.add(
        phase,
        fraction,
        accuracy=float(library.labels[np.argmax(probabilities)] == task),
        log_loss=-np.log(max(own, 1e-300)),
    )
    none = bool(posterior.probabilities[-1] > posterior.probabilities[:-1].max())
    collected.recognitions.add(
        phase, fraction, task, library.labels, probabilities, none, test.name
    )


def _prediction_scores(
    library: TaskLibrary, error: Floats, std: Floats, fraction: float
) -> tuple[dict[str, Floats], Floats]:
    """Scores of a prediction (T, Q), and its errors in predicted standard deviations."""
    density = 0.5 * (error / std) ** 2 + np.log(std) + 0.5 * np.log(2 * np.pi)
    squared, future = error**2, TRUTH_PHASES > fraction
    return {
        "rmse": np.sqrt(per_unit(library, squared)),
        "rmse_future": np.sqrt(per_unit(library, squared[future])),
        "end_rmse": np.sqrt(per_unit(library, squared[-1:])),
        "coverage_2_sigma": per_unit(library, (np.abs(error) < 2 * std).astype(float)),
        "nll": per_unit(library, density),
    }, error / std


def _without_none(posterior: TaskPosterior, hypotheses: PriorGrid) -> Floats:
    """Probabilities of the K tasks, (K,), renormalised in logs as none may outweigh all tasks."""
    log_task = (hypotheses.log_task_prior + posterior.log_evidence)[:-1]
    return np.exp(log_task - np.logaddexp.reduce(log_task))


def _snapshots(
    library: TaskLibrary,
    hypotheses: PriorGrid,
    test: Demonstration,
    fractions: list[float],
    monitor: DecisionMonitor | None,
) -> Iterator[tuple[float, MovementFilter]]:
    """Yield the filter after each share of the movement's time, in order."""
    run = MovementFilter(library, hypotheses, test.start_ns)
    for observation in merge(test.observed):
        elapsed = (observation.stamp_ns - test.start_ns) * 1e-9
        if not test.start_ns <= observation.stamp_ns <= test.end_ns:
            continue
        while fractions and elapsed > fractions[0] * test.duration_s + 1e-9:
            yield fractions.pop(0), run
        run.observe(observation)
        if monitor is not None:
            monitor.observe(run, elapsed)
    for fraction in fractions:
        yield fraction, run


def _baseline_scores(
    library: TaskLibrary,
    training: Sequence[Demonstration],
    test: Demonstration,
    fraction: float,
    truth: Floats,
    known: bool,
) -> dict[str, Floats]:
    same = [recorded for recorded in training if recorded.task == test.task]
    guesses = {
        "rmse_mean_of_task": mean_of_task(same, test, TRUTH_PHASES, known),
        "rmse_nearest_neighbour": nearest_neighbour(same, test, TRUTH_PHASES, fraction, known),
    }
    return {
        name: np.sqrt(per_unit(library, (guess - truth) ** 2)) for name, guess in guesses.items()
    }

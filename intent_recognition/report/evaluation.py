# SPDX-License-Identifier: Apache-2.0
"""How well recognition and prediction do on recordings left out of training."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from intent_recognition.errors import ArgumentError, IntentError, describe
from intent_recognition.promp.bank import (
    FilterBank,
    Hypotheses,
    fixed_hypotheses,
    make_hypotheses,
    start_bank,
)
from intent_recognition.promp.examples import Recorded, cut_to_movement
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.observations import BankRun, merge
from intent_recognition.promp.prediction import StartPosture, mixture_at
from intent_recognition.promp.recognition import TaskPosterior, task_posterior
from intent_recognition.promp.training import TrainingSettings, learn
from intent_recognition.report.baselines import mean_of_task, nearest_neighbour, sample

RECOGNITION_FRACTIONS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
PREDICTION_FRACTIONS = (0.25, 0.5, 0.75, 1.0)
TRUTH_PHASES = np.linspace(0.0, 1.0, 100)
PHASES = ("known_phase", "unknown_phase")
SMALLEST_PROBABILITY = 1e-300

Fold = tuple[list[int], list[int]]


def make_folds(n: int, protocol: str) -> list[Fold]:
    """Indices to train and to test on, for `loo` or `kfold:K` (index modulo K).

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


class Scores:
    """Sums of what is averaged over demonstrations, by phase knowledge, fraction and name."""

    def __init__(self):
        self._values: dict[tuple[str, float, str], list] = defaultdict(list)

    def add(self, phase: str, fraction: float, **values) -> None:
        """Add one demonstration's numbers (scalars, or (U,) arrays with one number per unit)."""
        for name, value in values.items():
            self._values[phase, fraction, name].append(value)

    def table(
        self, phase: str, fractions: Sequence[float], units: Sequence[str], names: Sequence[str]
    ) -> dict[str, dict[str, object]]:
        """Means over demonstrations: {fraction: {name: number}}, one number per unit if several."""
        return {
            str(fraction): {
                name: _number(self._values[phase, fraction, name], units) for name in names
            }
            for fraction in fractions
        }


def _number(values: list, units: Sequence[str]):
    if not values:
        return None
    mean = np.mean(np.array(values, dtype=np.float64), axis=0)
    if mean.ndim == 0:
        return float(mean)
    numbers = [None if np.isnan(x) else float(x) for x in mean]
    return numbers[0] if len(units) == 1 else dict(zip(units, numbers, strict=True))


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


def evaluate(
    demonstrations: Sequence[Recorded],
    folds: Sequence[Fold],
    settings: TrainingSettings,
    *,
    start_posture: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> dict:
    """Train on each fold's rest, score on what was left out; the JSON of `intent evaluate`.

    Args:
        demonstrations: labelled recordings with the same DOFs.
        folds: indices to train and to test on.
        settings: how to learn.
        start_posture: condition trajectories on the controlled agent's position at the start.
        progress: called with the number of demonstrations scored so far.

    Raises:
        TrainingError: a fold cannot be learned from.
    """
    if settings.segmentation == "movement":
        demonstrations = cut_to_movement(demonstrations)
        settings = replace(settings, segmentation="recording")
    scores = Scores()
    done, units, labels = 0, (), set()
    for train, test in folds:
        training = [demonstrations[i] for i in train]
        library, _ = learn(training, settings)
        units = tuple(dict.fromkeys(library.controlled_units))
        labels |= set(library.labels)
        for index in test:
            if demonstrations[index].task in library.labels:
                score_demonstration(scores, library, training, demonstrations[index], start_posture)
            else:
                for phase in PHASES:
                    for fraction in RECOGNITION_FRACTIONS:
                        scores.add(phase, fraction, accuracy=0.0, log_loss=-np.log(1e-12))
            done += 1
            progress(done)
    return {
        "n_demonstrations": done,
        "tasks": sorted(labels),
        "unit": units[0] if len(units) == 1 else list(units),
        "recognition": {
            phase: scores.table(phase, RECOGNITION_FRACTIONS, units, ("accuracy", "log_loss"))
            for phase in PHASES
        },
        "prediction": {
            phase: scores.table(phase, PREDICTION_FRACTIONS, units, PREDICTION_NAMES)
            for phase in PHASES
        },
    }


def score_demonstration(
    scores: Scores,
    library: TaskLibrary,
    training: Sequence[Recorded],
    test: Recorded,
    start_posture: bool,
) -> None:
    """Add one left-out demonstration's scores.

    Raises:
        IntentError: the demonstration has no duration.
    """
    duration = (test.end_ns - test.start_ns) * 1e-9
    if duration <= 0:
        raise IntentError(describe(test.name, "a positive duration", duration, "Leave it out."))
    times = TRUTH_PHASES * duration
    truth = sample(test.controlled, test.start_ns, times)
    start = None
    if start_posture:
        start = StartPosture(truth[0], np.zeros(library.n_controlled))
    label = library.labels.index(test.task)
    for phase in PHASES:
        known = phase == "known_phase"
        hypotheses = fixed_hypotheses(library, duration) if known else make_hypotheses(library)
        for fraction, bank in _snapshots(library, hypotheses, test, duration):
            posterior = task_posterior(bank, hypotheses, fraction * duration)
            probabilities = _without_none(posterior, hypotheses)
            if fraction in RECOGNITION_FRACTIONS:
                scores.add(
                    phase,
                    fraction,
                    accuracy=float(np.argmax(probabilities) == label),
                    log_loss=-np.log(max(probabilities[label], SMALLEST_PROBABILITY)),
                )
            if fraction in PREDICTION_FRACTIONS:
                scores.add(
                    phase,
                    fraction,
                    **_prediction_scores(
                        library,
                        bank,
                        hypotheses,
                        posterior.scale_weights[:-1],
                        probabilities,
                        label,
                        times,
                        truth,
                        fraction,
                        start,
                    ),
                    **_baseline_scores(library, training, test, fraction, truth, known),
                )


def _without_none(posterior: TaskPosterior, hypotheses: Hypotheses) -> np.ndarray:
    """Probabilities of the K tasks, renormalised in logs: none may outweigh all by far, (K,)."""
    log_prior = np.logaddexp.reduce(hypotheses.log_prior.reshape(-1, hypotheses.n_scales), axis=1)
    log_task = (log_prior + posterior.log_evidence)[:-1]
    return np.exp(log_task - np.logaddexp.reduce(log_task))


def _snapshots(
    library: TaskLibrary, hypotheses: Hypotheses, test: Recorded, duration_s: float
) -> Iterator[tuple[float, FilterBank]]:
    """The bank after each share of the movement's time, in order."""
    fractions = sorted({*RECOGNITION_FRACTIONS, *PREDICTION_FRACTIONS})
    run = BankRun(library, hypotheses, start_bank(library, hypotheses), test.start_ns)
    for observation in merge(test.observed):
        elapsed = (observation.stamp_ns - test.start_ns) * 1e-9
        if observation.stamp_ns > test.end_ns:
            break
        while fractions and elapsed > fractions[0] * duration_s + 1e-9:
            yield fractions.pop(0), run.bank
        run.observe(observation)
    for fraction in fractions:
        yield fraction, run.bank


def per_unit(library: TaskLibrary, values: np.ndarray) -> np.ndarray:
    """Means over the samples and the DOFs of each controlled unit, (U,), from (T, Q)."""
    units = np.array(library.controlled_units)
    if not values.size:
        return np.full(len(dict.fromkeys(units)), np.nan)
    return np.array([values[:, units == unit].mean() for unit in dict.fromkeys(units)])


def _prediction_scores(
    library: TaskLibrary,
    bank: FilterBank,
    hypotheses: Hypotheses,
    scale_weights: np.ndarray,
    probabilities: np.ndarray,
    label: int,
    times: np.ndarray,
    truth: np.ndarray,
    fraction: float,
    start: StartPosture | None,
) -> dict[str, np.ndarray]:
    given = np.zeros_like(scale_weights)
    given[label] = scale_weights[label]
    mean, std = mixture_at(library, bank, hypotheses, given, times, start)
    inferred, _ = mixture_at(
        library, bank, hypotheses, probabilities[:, None] * scale_weights, times, start
    )
    error = mean - truth
    density = 0.5 * (error / std) ** 2 + np.log(std) + 0.5 * np.log(2 * np.pi)
    squared, future = error**2, TRUTH_PHASES > fraction
    return {
        "rmse": np.sqrt(per_unit(library, squared)),
        "rmse_inferred_task": np.sqrt(per_unit(library, (inferred - truth) ** 2)),
        "rmse_future": np.sqrt(per_unit(library, squared[future])),
        "end_rmse": np.sqrt(per_unit(library, squared[-1:])),
        "coverage_2_sigma": per_unit(library, (np.abs(error) < 2 * std).astype(float)),
        "nll": per_unit(library, density),
    }


def _baseline_scores(
    library: TaskLibrary,
    training: Sequence[Recorded],
    test: Recorded,
    fraction: float,
    truth: np.ndarray,
    known: bool,
) -> dict[str, np.ndarray]:
    same = [recorded for recorded in training if recorded.task == test.task]
    guesses = {
        "rmse_mean_of_task": mean_of_task(same, test, TRUTH_PHASES, known),
        "rmse_nearest_neighbour": nearest_neighbour(same, test, TRUTH_PHASES, fraction, known),
    }
    return {
        name: np.sqrt(per_unit(library, (guess - truth) ** 2)) for name, guess in guesses.items()
    }

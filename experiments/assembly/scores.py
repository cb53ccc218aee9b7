# SPDX-License-Identifier: Apache-2.0
"""Recognition and prediction between two humans, on demonstrations left out of training.

A few observations of the worker's wrist, evenly spread over the whole movement, are taken one
after the other (Maeda et al. 2014, Fig. 8-9); the assistant's wrist is predicted from them.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from experiments.assembly.aligned import spread_rows
from intent_recognition.array_types import Floats
from intent_recognition.evaluation import mean_of_task, nearest_neighbour, sample
from intent_recognition.filtering import (
    MovementFilter,
    PriorGrid,
    fixed_prior_grid,
    make_prior_grid,
    task_posterior,
)
from intent_recognition.gaussian import Gaussian, log_density
from intent_recognition.promp import TaskLibrary
from intent_recognition.signals import Demonstration, Observation

N_OBSERVATIONS = 15
LAST = 5
"""The paper circles the last five observations of the fastening task."""
CERTAIN = 0.99
"""Probability from which the true task counts as certain; the paper says 100 %."""
TRUTH_PHASES = np.linspace(0.0, 1.0, 100)


class WatchedInteraction(NamedTuple):
    """Estimates for one left-out demonstration after each observation.

    Attributes:
        probabilities: of the K tasks, before any and after each of n observations, (n + 1, K).
        path_m: distance of the predicted from the true wrist, root mean square over the movement,
            (n + 1,).
        end_m: the same at its end, (n + 1,).
        inside: share of the coordinates within two predicted standard deviations, (n + 1,).
    """

    probabilities: Floats
    path_m: Floats
    end_m: Floats
    inside: Floats


class Scored(NamedTuple):
    """One left-out demonstration.

    Attributes:
        name: of the recording.
        task: its label.
        aligned: probabilities with all demonstrations aligned, as in the paper, (n + 1, K).
        known: with the share of the movement's time known.
        unknown: with onset known and duration not.
        forgetting: by Eq. 11 as printed, each time from the prior, elapsed share known, (n, K).
        single: from each observation by itself, elapsed share known, (n, K).
        mean_of_task: distances of the task's mean, path and end, (2,).
        nearest: the same of the demonstration whose worker moved most alike, (2,).
    """

    name: str
    task: str
    aligned: Floats
    known: WatchedInteraction
    unknown: WatchedInteraction
    forgetting: Floats
    single: Floats
    mean_of_task: Floats
    nearest: Floats


def spread_observations(recorded: Demonstration, n: int = N_OBSERVATIONS) -> list[Observation]:
    """The samples of the first signal that come nearest to n even phases."""
    (signal,) = recorded.observed
    phases = (signal.stamps_ns - recorded.start_ns) / (recorded.end_ns - recorded.start_ns)
    return [
        Observation(int(signal.stamps_ns[row]), 0, signal.values[row])
        for row in spread_rows(phases, n)
    ]


def score(
    library: TaskLibrary,
    training: Sequence[Demonstration],
    left_out: Demonstration,
    aligned_evidence: Floats,
) -> Scored:
    """Recognise and predict one demonstration the library has not seen.

    All are cut to their movements; the aligned log evidence of the tasks is (n + 1, K).
    """
    duration_s = (left_out.end_ns - left_out.start_ns) * 1e-9
    truth = sample(left_out.controlled, left_out.start_ns, TRUTH_PHASES * duration_s)
    observations = spread_observations(left_out)
    known, steps = watch(library, fixed_prior_grid(library, duration_s), left_out, observations)
    unknown, _ = watch(library, make_prior_grid(library), left_out, observations)
    same = [recorded for recorded in training if recorded.task == left_out.task]
    mean = mean_of_task(same, left_out, TRUTH_PHASES, known=True)
    nearest = nearest_neighbour(same, left_out, TRUTH_PHASES, 1.0, known=True)
    return Scored(
        left_out.name,
        str(left_out.task),
        _normalised(aligned_evidence),
        known,
        unknown,
        _normalised(np.diff(steps, axis=0)),
        _normalised(single_evidence(library, left_out, observations)),
        np.array(_distances(mean, truth)),
        np.array(_distances(nearest, truth)),
    )


def watch(
    library: TaskLibrary,
    hypotheses: PriorGrid,
    left_out: Demonstration,
    observations: Sequence[Observation],
) -> tuple[WatchedInteraction, Floats]:
    """Estimates after each observation, and log evidence of the tasks, (n + 1, K)."""
    duration_s = (left_out.end_ns - left_out.start_ns) * 1e-9
    times_s = TRUTH_PHASES * duration_s
    truth = sample(left_out.controlled, left_out.start_ns, times_s)
    run = MovementFilter(library, hypotheses, left_out.start_ns)
    evidence, probabilities, scores = [], [], []
    for observation in (None, *observations):
        elapsed_s = 0.0
        if observation is not None:
            run.observe(observation)
            elapsed_s = (observation.stamp_ns - left_out.start_ns) * 1e-9
        posterior = task_posterior(run.log_evidence, hypotheses, elapsed_s)
        evidence.append(posterior.log_evidence[:-1])
        (belief,) = _normalised(evidence[-1][None])
        probabilities.append(belief)
        mean, std = _mixture(run, belief, times_s)
        inside = float(np.mean(np.abs(mean - truth) <= 2.0 * std))
        scores.append((*_distances(mean, truth), inside))
    path, end, inside = np.array(scores).T
    return WatchedInteraction(np.array(probabilities), path, end, inside), np.array(evidence)


def _mixture(run: MovementFilter, belief: Floats, times_s: Floats) -> tuple[Floats, Floats]:
    """Mean and standard deviation of the assistant's wrist over all likely tasks, (T, 3)."""
    likely = np.flatnonzero(belief > 1e-3)
    share = belief[likely] / belief[likely].sum()
    moments = [run.prediction(int(task)).mixture_at(times_s) for task in likely]
    parts = (np.array(part) for part in zip(*moments, strict=True))
    mean, square = (np.tensordot(share, part, axes=1) for part in parts)
    return mean, np.sqrt(np.maximum(square - mean**2, 1e-12))


def single_evidence(
    library: TaskLibrary, recorded: Demonstration, observations: Sequence[Observation]
) -> Floats:
    """Log density of each observation by itself under each task, elapsed share known, (n, K)."""
    return np.array(
        [
            [
                log_density(at_phase(library, task, phase), observation.values)
                for task in range(library.n_tasks)
            ]
            for phase, observation in zip(
                phases_of(recorded, observations), observations, strict=True
            )
        ]
    )


def at_phase(library: TaskLibrary, task: int, phase: float) -> Gaussian:
    """The worker's wrist under a task at a phase, with the observation's noise (Eq. 10)."""
    row = library.basis.design_matrix(np.array([phase]))
    design = np.kron(np.eye(library.n_observed), row)
    noise = library.noise_covariance(np.arange(library.n_observed), np.inf)
    covariance = design @ library.observed_covariance[task] @ design.T + noise
    return Gaussian(design @ library.observed_mean[task], covariance)


def phases_of(recorded: Demonstration, observations: Sequence[Observation]) -> Floats:
    """Share of the movement's time that had passed at each observation, (n,)."""
    stamps = np.array([observation.stamp_ns for observation in observations])
    return (stamps - recorded.start_ns) / (recorded.end_ns - recorded.start_ns)


def observations_to_certainty(probabilities: Floats, truth: int) -> int | None:
    """After how many observations (rows of (n + 1, K)) the true task is certain and stays so; None
    if never.
    """
    uncertain = np.flatnonzero(probabilities[:, truth] < CERTAIN)
    if not uncertain.size:
        return 0
    return None if uncertain[-1] + 1 == len(probabilities) else int(uncertain[-1] + 1)


def _distances(predicted: Floats, truth: Floats) -> tuple[float, float]:
    """Root mean square over the movement and at its end of the distance between paths (T, 3)."""
    squared = np.sum((predicted - truth) ** 2, axis=1)
    return float(np.sqrt(squared.mean())), float(np.sqrt(squared[-1]))


def _normalised(log_evidence: Floats) -> Floats:
    """Probabilities under equal priors, row by row, from log densities (n, K)."""
    return np.exp(log_evidence - np.logaddexp.reduce(log_evidence, axis=1, keepdims=True))

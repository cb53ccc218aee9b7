# SPDX-License-Identifier: Apache-2.0
"""Recognition and prediction from the arrays of a movement, whole or in part."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.errors import ArgumentError, ShapeError, check_type, number
from intent_recognition.filtering import MovementFilter, fixed_prior_grid, make_prior_grid
from intent_recognition.promp import NONE, TaskLibrary, Trajectory
from intent_recognition.recognition.arguments import LIBRARY_CURE, observation_error
from intent_recognition.recognition.estimate import Estimate
from intent_recognition.recognition.observed import FirstSamples, ObservedTurns
from intent_recognition.signals import as_numbers, as_stamp_ns, check_times, observations_of


def recognize_task(
    library: TaskLibrary,
    times_s: ArrayLike,
    human: ArrayLike,
    *,
    onset_s: float | None = None,
    duration_s: float | None = None,
) -> Estimate:
    """Task probabilities of one movement, or of its first part.

    Maeda et al. 2014, Eq. 9-11. `IntentEstimator` does the same for a stream, and detects the onset
    itself.

    Args:
        library: the learned tasks.
        times_s: increasing times of the samples, (T,) [s].
        human: positions of the observed DOFs, (T, P), in the units of the library. NaN marks values
            that were not measured; they are left out, not imputed.
        onset_s: time at which the movement began [s]; None for the first sample. Pass it if the
            samples begin at rest: rest before the onset would count as part of the movement.
        duration_s: duration of the whole movement [s]; None marginalises over durations.

    Returns:
        The estimate at the last sample: `task`, `task_probabilities`, `phase`, `log_evidence`.

    Raises:
        ShapeError: the arrays do not fit each other or the library.
        ArgumentError: times do not increase or seem not to be seconds, a value is infinite or seems
            not to be in the learned unit, or nothing was measured.
    """
    run = _filtered(library, times_s, human, onset_s, duration_s)
    last_ns = run.observations[-1].stamp_ns
    return Estimate.of(last_ns, run.onset_ns, run.posterior(last_ns), (*library.labels, NONE))


def predict_controlled(
    library: TaskLibrary,
    times_s: ArrayLike,
    human: ArrayLike,
    *,
    task: str | None = None,
    onset_s: float | None = None,
    duration_s: float | None = None,
    n_points: int = 50,
) -> Trajectory:
    """Trajectory of the controlled agent, given a movement or its first part.

    It covers the whole interaction; its times count from onset. `IntentEstimator` predicts the same
    for a stream.

    Args:
        library: the learned tasks.
        times_s: as in `recognize_task`.
        human: as in `recognize_task`.
        task: label of the task; None for the most probable one.
        onset_s: as in `recognize_task`.
        duration_s: as in `recognize_task`.
        n_points: number of points in time, at least 1; a single point is the end.

    Raises:
        ShapeError: the arrays do not fit each other or the library.
        ArgumentError: as in `recognize_task`, or there is no such task.
    """
    run = _filtered(library, times_s, human, onset_s, duration_s)
    if task is None:
        known = run.posterior(run.observations[-1].stamp_ns).probabilities[:-1]
        return run.prediction(int(np.argmax(known))).controlled(n_points)
    if task not in library.labels:
        cure = "Learn it first, or pass None for the most probable task."
        raise ArgumentError.about("task", f"one of {library.labels}", task, cure)
    return run.prediction(library.labels.index(task)).controlled(n_points)


def _filtered(
    library: TaskLibrary,
    times_s: ArrayLike,
    human: ArrayLike,
    onset_s: float | None,
    duration_s: float | None,
) -> MovementFilter:
    """Filter conditioned on the checked samples from onset on, of which there must be one."""
    check_type("library", library, TaskLibrary, LIBRARY_CURE)
    if duration_s is not None and not 0.0 < number(duration_s) < np.inf:
        cure = "Pass None when it is not known."
        raise ArgumentError.about("duration_s", "a positive number", duration_s, cure)
    times, values = as_numbers("times_s", times_s), as_numbers("human", human)
    if times.ndim != 1 or not times.size or values.shape != (times.size, library.n_observed):
        expected = f"times_s (T,) and human (T, {library.n_observed})"
        got = f"{times.shape} and {values.shape}"
        cure = "Pass one row per time, one column per DOF; human[:, None] for one DOF."
        raise ShapeError.about("times_s, human", expected, got, cure)
    check_times("times_s", times)
    if np.any(np.isinf(values)):
        cure = "Set what was not measured to NaN."
        raise ArgumentError.about("human", "finite numbers or NaN", "infinity", cure)
    grid = fixed_prior_grid(library, duration_s) if duration_s else make_prior_grid(library)
    stamps_ns = np.round(times * 1e9).astype(np.int64)
    onset_ns = int(stamps_ns[0]) if onset_s is None else as_stamp_ns("onset_s", onset_s)
    run, turns = MovementFilter(library, grid, onset_ns), ObservedTurns(library)
    first_samples = FirstSamples(library)
    for observation in observations_of(library.observed_groups, stamps_ns, values):
        if first_samples.refuse(observation):
            raise observation_error("unit", observation, library.n_observed, first_samples.misfit)
        if observation.stamp_ns >= onset_ns:
            run.observe(turns.bring(observation))
    if not run.observations:
        cure = "Pass at least one measured sample of the movement."
        raise ArgumentError.about("human", "a sample at or after onset", "none", cure)
    return run

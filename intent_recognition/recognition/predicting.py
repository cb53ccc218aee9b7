# SPDX-License-Identifier: Apache-2.0
"""Both agents' predictions from the movement under way and the controlled agent's posture."""

import numpy as np

from intent_recognition.array_types import Floats, read_only
from intent_recognition.filtering import MovementFilter
from intent_recognition.promp import NONE, TaskLibrary, Trajectory
from intent_recognition.recognition.estimate import Prediction
from intent_recognition.recognition.start_posture import OnsetPosture, rest_posture


class Predictor:
    """Predicts the movement under way; remembers the last prediction while nothing changes.

    Args:
        posture: of the controlled agent at onset.
    """

    def __init__(self, posture: OnsetPosture):
        self._posture = posture
        self._last: tuple[Trajectory, Prediction] | None = None

    def controlled(
        self, taught: TaskLibrary, run: MovementFilter, task: int, n_points: int
    ) -> Prediction:
        """The controlled agent's whole interaction under a task.

        Args:
            taught: the library in the known context.
            run: the movement, filtered with the library in use.
            task: number of the task.
            n_points: T.
        """
        library = run.library
        start, used, turns = self._posture.at_onset(taught, task, run.onset_ns)
        along = run.controlled(task, n_points, start)
        if self._last is None or self._last[0] is not along or self._last[1].start != used:
            turned = along._replace(positions=along.positions + turns)
            names, units = library.controlled_names, library.controlled_units
            label = library.labels[task]
            found = Prediction(label, run.onset_ns, turned, used, names, units)
            self._last = along, read_only(found)
        return self._last[1]

    def controlled_at(
        self, taught: TaskLibrary, run: MovementFilter, known: Floats, times_s: Floats
    ) -> Trajectory:
        """Where the controlled agent is at some times, over all known tasks.

        Args:
            taught: as in `controlled`.
            run: as in `controlled`.
            known: probabilities of the known tasks, (K,).
            times_s: on the clock of the observations, (T,).
        """
        known = np.maximum(known, 1e-12)  # above zero also where `none` is certain
        given = [self._posture.at_onset(taught, task, run.onset_ns) for task in range(len(known))]
        since_s = np.maximum(times_s - run.onset_ns * 1e-9, 0.0)
        half_s = 0.005  # velocities are taken from both sides
        around_s = np.concatenate([since_s, since_s + half_s, since_s - half_s])
        mean, std = run.mixture_at(around_s, known, [start for start, _, _ in given])
        mean, after, before = np.split(mean, 3)
        velocities = (after - before) / (2.0 * half_s)
        turns = given[int(np.argmax(known))][2]
        return Trajectory(times_s, mean + turns, velocities, std[: len(times_s)])


def expected_at_rest(library: TaskLibrary, task_prior: Floats, times_s: Floats) -> Trajectory:
    """Where the controlled agent is expected before the next movement, whatever the time (T,).

    Args:
        library: the learned tasks.
        task_prior: their probabilities, (K,).
        times_s: on the clock of the observations.
    """
    posture = rest_posture(library, task_prior)
    mean, std = (np.tile(part, (len(times_s), 1)) for part in posture)
    return Trajectory(times_s, mean, np.zeros_like(mean), std)


def predict_observed(run: MovementFilter, task: int, n_points: int) -> Prediction:
    """The rest of the observed agent's movement under a task, or none.

    Args:
        run: the movement.
        task: number of the task; K is none.
        n_points: T.
    """
    library, trajectory = run.library, run.prediction(task).observed(n_points)
    label, units = (*library.labels, NONE)[task], library.observed_units
    return Prediction(label, run.onset_ns, trajectory, names=library.observed_names, units=units)

# SPDX-License-Identifier: Apache-2.0
"""The controlled agent's posture at onset, if it is among the trained starts.

It conditions trajectories (`prediction.controlled_weights`), never the evidence of the tasks: the
robot's own posture tells nothing about the human.
"""

from collections import defaultdict, deque

import numpy as np
from scipy.special import chdtri

from intent_recognition.array_types import Floats
from intent_recognition.promp import (
    ControlPoint,
    StartPosture,
    TaskLibrary,
    Trajectory,
    controlled_at,
    controlled_spread,
    distance_to,
)
from intent_recognition.signals import (
    CLOCK_RESET_AFTER,
    LateSamples,
    Observation,
    turns_of,
    whole_turns,
)

POSTURE_USED, POSTURE_OUTSIDE, POSTURE_UNKNOWN = "used", "outside", "unknown"
MAX_AGE_S = 0.25
"""Largest age at onset of a sample that is taken as the posture at onset [s]
(docs/anticipation.md)."""
SPAN_S = 4.0
"""Length of the past that is kept [s]: twice the longest delay of onset detection."""
START_STD = {"m": 0.02, "rad": 0.02}
"""Standard deviation of a controlled DOF about its commanded start, by unit: sag and calibration of
a joint [rad], a wrist that returns to its place [m].

If all demonstrations began in one posture, the learned variance of the start is that of noise
alone. Without this, a deviation of a milliradian at the start would become centimetres at the end.
"""
START_SHARE = 0.05
"""The same for other units, relative to the spread of the demonstrations
(`promp.controlled_spread`), such as the bias of a wrench or a camera."""


class PostureHistory:
    """Latest samples of the controlled agent's signals."""

    def __init__(self) -> None:
        self._samples: list[deque[tuple[int, Floats]]] = []
        self._late = defaultdict[int, LateSamples](LateSamples)

    def take(self, stamp_ns: int, group: int, values: Floats) -> str | None:
        """Take a sample (m,) of a controlled signal; return a diagnostics key if it was refused.

        `group` is the index of the signal, in the order of the DOF file.
        """
        while group >= len(self._samples):
            self._samples.append(deque())
        samples = self._samples[group]
        if not np.all(np.isfinite(values)):
            return "not_finite"
        if samples and stamp_ns <= samples[-1][0]:
            if self._late[group].count(stamp_ns) < CLOCK_RESET_AFTER:
                return "stamp_not_increasing"
            samples.clear()
        self._late[group].forget()
        samples.append((stamp_ns, np.array(values, dtype=np.float64)))
        while stamp_ns - samples[0][0] > SPAN_S * 1e9:
            samples.popleft()
        return None

    def at(self, stamp_ns: int) -> Floats | None:
        """Last values of all DOFs up to a stamp, (Q,); None if one is missing or too old."""
        parts = []
        for samples in self._samples:
            before = next((s for s in reversed(samples) if s[0] <= stamp_ns), None)
            if before is None or stamp_ns - before[0] > MAX_AGE_S * 1e9:
                return None
            parts.append(before[1])
        return np.concatenate(parts) if parts else None

    def passed(self, stamp_ns: int) -> bool:
        """Whether all signals have samples from a stamp on, so that `at` is final."""
        return all(samples and samples[-1][0] >= stamp_ns for samples in self._samples)


class OnsetPosture:
    """Posture at onset of the movement under way, checked against each task's starts."""

    def __init__(self, library: TaskLibrary, *, used: bool) -> None:
        self._library, self._used = library, used
        self.clear()

    def take(self, observation: Observation) -> str | None:
        """Take a sample; return a diagnostics key if it was refused, else None."""
        if not self._used:
            return None
        reason = self._history.take(observation.stamp_ns, observation.group, observation.values)
        if not self._final:
            self._find(self._onset_ns)
        return reason

    def follow(self, onset_ns: int) -> None:
        """Look up the posture at the onset of a movement, now and until it is final."""
        if onset_ns != self._onset_ns:
            self._find(onset_ns)

    def _find(self, onset_ns: int) -> None:
        self._onset_ns, self._position = onset_ns, self._history.at(onset_ns)
        self._final = self._history.passed(onset_ns)
        # by task: the posture or None, its use, and whole turns
        self._known: dict[int, tuple[StartPosture | None, str, Floats]] = {}

    def clear(self) -> None:
        """Forget everything."""
        self._history = PostureHistory()
        self._find(0)

    def use(self, library: TaskLibrary) -> None:
        """Switch to another library, which has other starts."""
        self._library = library
        self._known.clear()

    def at_onset(self, task: int) -> tuple[StartPosture | None, str, Floats]:
        """Posture to condition on or None, and POSTURE_USED, POSTURE_OUTSIDE or POSTURE_UNKNOWN.

        The third result is the whole turns of the arm from the learned start, (Q,) [rad].
        """
        library, position = self._library, self._position
        none = np.zeros(library.n_controlled)
        if position is None or position.shape != none.shape:
            return None, POSTURE_UNKNOWN, none
        if task not in self._known:
            apart, turn = position - start_mean(library, task), turns_of(library.controlled_units)
            turns = whole_turns(apart, turn)  # zero for DOFs that are no angles
            if within_trained_starts(library, task, position - turns):
                start = StartPosture(position - turns, start_variance(library))
                self._known[task] = start, POSTURE_USED, turns
            else:
                self._known[task] = None, POSTURE_OUTSIDE, none
        return self._known[task]


def start_variance(library: TaskLibrary) -> Floats:
    """Variance of a posture about the commanded one, per controlled DOF, (Q,)."""
    std = START_SHARE * controlled_spread(library)
    units = library.controlled_units
    return np.array([START_STD.get(unit, own) for unit, own in zip(units, std, strict=True)]) ** 2


def start_distance(library: TaskLibrary, task: int, position: Floats) -> float:
    """Squared Mahalanobis distance of a controlled posture (Q,) from a task's starts."""
    noise = np.diag(library.control_noise_variance() + start_variance(library))
    start = ControlPoint(0.0, np.eye(library.n_controlled), position, noise)
    return distance_to(library, task, start) ** 2


def within_trained_starts(library: TaskLibrary, task: int, position: Floats) -> bool:
    """Whether a controlled posture (Q,) is among the starts with which the task was trained.

    The learned covariance is predictive, so the squared distance of a start from the same
    distribution is chi-square with Q degrees of freedom.
    """
    limit = float(chdtri(library.n_controlled, 0.001))  # refuses one in a thousand such starts
    return start_distance(library, task, position) <= limit


def start_mean(library: TaskLibrary, task: int) -> Floats:
    """Mean controlled posture at the start of a task, (Q,)."""
    return controlled_at(library, task, 0.0).mean


def rest_poses(library: TaskLibrary, task_prior: Floats, times_s: Floats) -> Trajectory:
    """Expected start of the controlled agent in the next movement, the same at all times (T,).

    It is the mixture of the tasks' starts by their probabilities, (K,).
    """
    starts = [controlled_at(library, task, 0.0) for task in range(library.n_tasks)]
    mean = np.array([one.mean for one in starts])
    variance = np.array([np.diag(one.covariance) for one in starts])
    expected = task_prior @ mean
    square = task_prior @ (variance + (mean - expected) ** 2)
    std = np.sqrt(square + library.control_noise_variance())
    positions, std = (np.tile(part, (len(times_s), 1)) for part in (expected, std))
    return Trajectory(times_s, positions, np.zeros_like(positions), std)

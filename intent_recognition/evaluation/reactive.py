# SPDX-License-Identifier: Apache-2.0
"""Reactive prediction of the controlled agent: its present and near-future pose at every moment.

Task and phase are unknown. The observed agent's motion so far and the controlled agent's posture at
the start are known, as they are online (`IntentEstimator.predict_controlled_at`).
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from intent_recognition.array_types import Floats
from intent_recognition.evaluation.scores import ScoreTable, per_unit, sample
from intent_recognition.filtering import MovementFilter
from intent_recognition.promp import StartPosture
from intent_recognition.signals import Demonstration, Signal

HORIZONS_S = (0.0, 0.25, 0.5, 1.0)
"""Prediction horizons of the controlled agent [s] (docs/recognition.md)."""
MOMENTS = tuple(k / 20 for k in range(1, 21))
"""Shares of a recording at which predictions are scored; 20 moments bound the time."""
WINDOW, N_NEAREST = 5, 20
"""Samples of the observed agent in a window of the baseline, and number of nearest windows that it
averages."""
REACTIVE_NAMES = ("mse", "mse_nearest_windows", "mse_last_pose")


class NearestWindows:
    """Baseline: mean controlled pose beside the training windows most similar to the last one."""

    def __init__(self, training: Sequence[Demonstration]):
        intervals = [np.median(np.diff(one.observed[0].stamps_ns)) for one in training]
        self._interval_s = float(np.median(intervals)) * 1e-9
        windows, poses = [], []
        for one in training:
            times_s = np.arange(WINDOW - 1, one.duration_s / self._interval_s) * self._interval_s
            windows.append(self._windows(one.observed, one.start_ns, times_s))
            ahead_s = (times_s[:, None] + HORIZONS_S).ravel()
            ahead = sample(one.controlled, one.start_ns, ahead_s)
            poses.append(ahead.reshape(len(times_s), len(HORIZONS_S), -1))
        stacked = np.concatenate(windows)
        self._scale = _scale(stacked, training[0].observed)
        self._tree, self._poses = cKDTree(stacked / self._scale), np.concatenate(poses)

    def predict(self, seen: Demonstration, elapsed_s: float) -> Floats:
        """Predict poses at `HORIZONS_S` after a moment, (H, Q), from the motion so far."""
        window = self._windows(seen.observed, seen.start_ns, np.array([elapsed_s])) / self._scale
        _, nearest = self._tree.query(window[0], min(N_NEAREST, len(self._poses)))
        return self._poses[np.atleast_1d(nearest)].mean(axis=0)

    def _windows(self, signals: Sequence[Signal], start_ns: int, times_s: Floats) -> Floats:
        """Windows that end at the given times after a stamp, (T, WINDOW P)."""
        back_s = self._interval_s * np.arange(WINDOW - 1, -1, -1)
        values = sample(signals, start_ns, (times_s[:, None] - back_s).ravel())
        return values.reshape(len(times_s), -1)


def _scale(windows: Floats, signals: Sequence[Signal]) -> Floats:
    """Divisor of each value of a window, which makes DOFs of different units comparable."""
    units = np.array([signal.unit for signal in signals for _ in signal.names])
    scale = np.ones(len(units))
    if len(set(units)) > 1:
        std = windows.reshape(len(windows), WINDOW, -1).std(axis=(0, 1))
        for unit in set(units):
            scale[units == unit] = std[units == unit].max() or 1.0
    return np.tile(scale, WINDOW)


def score_reactive(
    scores: ScoreTable,
    run: MovementFilter,
    task_weights: Floats,
    test: Demonstration,
    elapsed_s: float,
    start: StartPosture,
    windows: NearestWindows,
) -> None:
    """Add the squared errors of a held-out recording at a time after its start [s], by horizon.

    The filter has run up to this time; the K tasks have the probabilities `task_weights`, (K,).
    `start` is the posture of the controlled agent at its start.
    """
    times_s = elapsed_s + np.array(HORIZONS_S)
    times_s = times_s[times_s <= test.duration_s + 1e-9]
    truth = sample(test.controlled, test.start_ns, times_s)
    predicted, _ = run.mixture_at(times_s, task_weights, start)
    nearest = windows.predict(test, elapsed_s)[: len(times_s)]
    for k, horizon_s in enumerate(HORIZONS_S[: len(times_s)]):
        guesses = predicted[k], nearest[k], start.position
        errors = [per_unit(run.library, (guess - truth[k])[None] ** 2) for guess in guesses]
        scores.add(str(test.task), horizon_s, **dict(zip(REACTIVE_NAMES, errors, strict=True)))

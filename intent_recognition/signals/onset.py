# SPDX-License-Identifier: Apache-2.0
"""Detect onset and rest of a movement by one causal rule for training, replay and the nodes.

A signal moves when the slope of a line through its last `window_s` exceeds a share of the typical
peak speed for `persistence_s`. A reach begins with displacement x ~ t^3 (minimum jerk, Flash &
Hogan 1985), so with displacement x and speed v it began 3 x / v earlier.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.signals.signal import MIN_SAMPLES, Signal

BLOCK_S = 10.0
"""Length of the blocks of samples that are summed from their own time origin [s]. With a single
origin, the squared times of an hour cause an error of 5 % in a speed at 100 Hz."""


@dataclass(frozen=True)
class OnsetSettings:
    """Thresholds that distinguish movement from rest.

    Raises:
        ArgumentError: a setting is not positive.
    """

    reference_speed: float  # typical peak speed, the norm over the observed DOFs, per second
    start_share: float = 0.15  # share of the reference speed above which a signal moves
    rest_share: float = 0.1  # share of the reference speed below which a signal rests
    window_s: float = 0.15  # length of the line fitted for the speed
    persistence_s: float = 0.08  # time for which the speed must stay above (below) the threshold
    rest_s: float = 0.3  # time of rest after a movement before the next one may begin
    max_backdate_s: float = 0.7  # longest time from the onset to the middle of the window

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0):
                cure = "See OnsetSettings for defaults."
                raise ArgumentError.about(name, "a positive number", value, cure)


def windowed_velocity(times_s: Floats, values: Floats, window_s: float) -> Floats:
    """Velocity (T, d) of values (T, d) at increasing times (T,), computed causally.

    At each sample it is the slope of a line through the samples of the last `window_s`, or NaN if
    these are fewer than three or span less than half the window.
    """
    times_s = np.asarray(times_s, dtype=np.float64)
    first = np.searchsorted(times_s, times_s - window_s - 1e-9)
    blocks = np.flatnonzero(np.diff((times_s - times_s[:1]) // BLOCK_S)) + 1
    slopes = []
    for start, stop in pairwise([0, *blocks.tolist(), len(times_s)]):
        begin = first[start] if start else 0
        near = slice(begin, stop)
        slopes.append(_slopes(times_s[near], values[near], first[start:stop] - begin, window_s))
    return np.concatenate(slopes)


def _slopes(times_s: Floats, values: Floats, first: Integers, window_s: float) -> Floats:
    """Slopes (N, d) at the last N samples, of lines through the samples from `first` (N,) on."""
    last = np.arange(len(times_s) - len(first), len(times_s)) + 1
    centre = values - values[:1]

    def window_sum(samples: Floats) -> Floats:
        total = np.concatenate([np.zeros((1, samples.shape[1])), np.cumsum(samples, axis=0)])
        return total[last] - total[first]

    count = (last - first)[:, None].astype(np.float64)
    t = (times_s - times_s[:1])[:, None]
    sum_t, sum_y = window_sum(t), window_sum(centre)
    sum_of_squares = window_sum(t * t) - sum_t**2 / count
    covariance = window_sum(t * centre) - sum_t * sum_y / count
    enough = (count >= 3) & ((times_s[last - 1] - times_s[first])[:, None] >= 0.5 * window_s)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(enough, covariance / sum_of_squares, np.nan)


def peak_speed(times_s: Floats, values: Floats, window_s: float = 0.15) -> float:
    """Largest norm of the windowed velocity, per second; 0 if the signal is too short.

    The signal has values (T, P) at increasing times (T,) [s].
    """
    if len(times_s) < 3:
        return 0.0
    speed = np.linalg.norm(windowed_velocity(times_s, values, window_s), axis=1)
    return float(np.nanmax(speed)) if np.any(np.isfinite(speed)) else 0.0


def speed_noise(times_s: Floats, values: Floats, window_s: float = 0.15) -> float:
    """Root mean square of the windowed velocity that white measurement noise alone would cause.

    The noise is estimated from the distance of each sample from the line between its neighbours, by
    the median, since movements bend where they turn or start. 0 if the signal is too short.
    """
    if len(times_s) < MIN_SAMPLES:
        return 0.0
    steps = np.diff(times_s)
    share = (steps[:-1] / (steps[:-1] + steps[1:]))[:, None]
    bend = values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]
    bend /= np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    # the median of chi-square with one degree of freedom
    variance = float(np.sum(np.median(bend**2, axis=0))) / 0.4549
    # Squared centred times of n + 1 equally spaced samples: window_s^2 (n + 1) (n + 2) / (12 n).
    n = max(window_s / float(np.median(steps)), 1.0)
    return float(np.sqrt(variance * 12.0 * n / ((n + 1.0) * (n + 2.0)))) / window_s


def detect_onset(settings: OnsetSettings, times_s: Floats, values: Floats) -> float | None:
    """Onset of the movement in progress at the last sample, None if there is no movement.

    The recent past is given by positions (T, P) of the observed DOFs at increasing times (T,).
    """
    if len(times_s) < 4:
        return None
    speed = np.linalg.norm(windowed_velocity(times_s, values, settings.window_s), axis=1)
    threshold = settings.start_share * settings.reference_speed
    moving = speed > threshold
    if not moving[-1]:
        return None
    still = np.flatnonzero(~moving)
    first = int(still[-1]) + 1 if still.size else 0
    if times_s[-1] - times_s[first] < settings.persistence_s - 1e-9:
        return None
    before = times_s <= times_s[first] - settings.window_s
    recent = before & (times_s >= times_s[first] - settings.window_s - 0.3)
    rest = values[recent if np.any(recent) else slice(0, 1)].mean(axis=0)
    # Displacement and speed both refer to the middle of the window to which the line was fitted.
    window = times_s >= times_s[-1] - settings.window_s - 1e-9
    displacement = float(np.linalg.norm(values[window].mean(axis=0) - rest))
    backdate = 3.0 * displacement / max(float(speed[-1]), threshold)
    onset = times_s[window].mean() - np.fmin(backdate, settings.max_backdate_s)  # ignores NaN
    return float(np.clip(onset, times_s[0], times_s[first]))


def at_rest(
    settings: OnsetSettings, times_s: Floats, values: Floats, rest_s: float | None = None
) -> bool:
    """Whether the signal has rested for the last `rest_s`, by default the settings' own.

    The other arguments are as in `detect_onset`.
    """
    rest_s = settings.rest_s if rest_s is None else rest_s
    if len(times_s) < 4 or times_s[-1] - times_s[0] < rest_s:
        return False
    speed = np.linalg.norm(windowed_velocity(times_s, values, settings.window_s), axis=1)
    recent = speed[times_s >= times_s[-1] - rest_s]
    limit = settings.rest_share * settings.reference_speed
    return bool(np.all(recent < limit))


def is_slow(settings: OnsetSettings, velocity: Floats | None) -> bool:
    """Whether an `end_velocity` is below the speed limit of `at_rest`; False if it is None."""
    limit = settings.rest_share * settings.reference_speed
    return velocity is not None and bool(velocity @ velocity < limit**2)


def end_velocity(settings: OnsetSettings, times_s: Floats, values: Floats) -> Floats | None:
    """The last row (P,) of `windowed_velocity`; None if it cannot be computed.

    The samples are those of the last `window_s`, values (T, P) at times (T,).
    """
    if len(times_s) < 3 or times_s[-1] - times_s[0] < 0.5 * settings.window_s:
        return None
    time = times_s - np.add.reduce(times_s) / len(times_s)
    return np.asarray((time @ values) / (time @ time), dtype=np.float64)


def first_onset(settings: OnsetSettings, times_s: Floats, values: Floats) -> float | None:
    """Onset of the first movement of a recording, as it would have been detected online.

    Equal to calling `detect_onset` at every sample until it returns an onset; same arguments.
    """
    speed = np.linalg.norm(windowed_velocity(times_s, values, settings.window_s), axis=1)
    moving = speed > settings.start_share * settings.reference_speed
    edges = np.flatnonzero(np.diff(np.r_[False, moving].astype(int)) == 1)
    for edge in edges:
        fallen = np.flatnonzero(~moving[edge:])
        end = edge + fallen[0] if fallen.size else len(moving)
        sure = np.searchsorted(times_s[:end], times_s[edge] + settings.persistence_s - 1e-9)
        if sure < end:
            return detect_onset(settings, times_s[: sure + 1], values[: sure + 1])
    return None


def earliest_onset(
    settings: Sequence[OnsetSettings], signals: Sequence[Signal], start_ns: int
) -> float | None:
    """Earliest `first_onset` of several signals [s after `start_ns`]; None if no signal moves."""
    onsets = [
        first_onset(own, signal.seconds(start_ns), signal.values)
        for own, signal in zip(settings, signals, strict=True)
    ]
    return min((onset for onset in onsets if onset is not None), default=None)


def latest_motion(
    settings: Sequence[OnsetSettings], signals: Sequence[Signal], start_ns: int
) -> float | None:
    """Latest `last_motion` of several signals [s after `start_ns`]; None without samples."""
    ends = [
        last_motion(own, signal.seconds(start_ns), signal.values)
        for own, signal in zip(settings, signals, strict=True)
        if signal.stamps_ns.size
    ]
    return max(ends, default=None)


def last_motion(settings: OnsetSettings, times_s: Floats, values: Floats) -> float:
    """Time at which the last movement of a recording ended; its first time if it never moved.

    It is the onset in the time-reversed recording, so that noise is treated as in onset detection.
    It is not causal and serves to cut recordings in training. Arguments as in `detect_onset`.
    """
    onset = first_onset(settings, -times_s[::-1], values[::-1])
    return float(times_s[0]) if onset is None else -onset

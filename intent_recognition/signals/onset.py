# SPDX-License-Identifier: Apache-2.0
"""Onset and rest of a movement, by one causal rule for training, replay and the nodes.

A signal moves when the slope of a line through its last `window_s` exceeds a share of the typical
peak speed for `persistence_s`. A reach begins with displacement x ~ t^3 (minimum jerk, Flash &
Hogan 1985), so it began 3 x / v before the moment it has displacement x and speed v.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.errors import ArgumentError
from intent_recognition.signals.signal import MIN_SAMPLES, Signal

BLOCK_S = 10.0
"""Samples whose sums have an origin of their own [s]: of one origin, the squared times of an hour
leave an error of 5 % in a speed at 100 Hz."""


@dataclass(frozen=True)
class OnsetSettings:
    """How onset and rest are told apart.

    Raises:
        ArgumentError: a setting is not positive.
    """

    reference_speed: float  # typical peak speed of the observed DOFs' norm, per second
    start_share: float = 0.15  # share of it that counts as moving
    rest_share: float = 0.1  # share of it below which a signal rests
    window_s: float = 0.15  # length of the line fitted for the speed
    persistence_s: float = 0.08  # how long the speed must stay above (below) the threshold
    rest_s: float = 0.3  # how long a finished movement must rest before the next one may begin
    max_backdate_s: float = 0.7  # earliest onset before its detection

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0):
                cure = "See OnsetSettings for defaults."
                raise ArgumentError.about(name, "a positive number", value, cure)


def windowed_velocity(times_s: Floats, values: Floats, window_s: float) -> Floats:
    """Slope of a line through the samples of the last `window_s` at each sample, (T, d).

    Causal, of values (T, d) at increasing times (T,). NaN where fewer than three samples, or less
    than half the window, are there.
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
    """Slopes at the last samples, (N, d), of lines through those from `first` (N,) on."""
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
    """Largest norm of the windowed velocity, per second; 0 for a signal too short to tell.

    Of values (T, P) at increasing times (T,) [s].
    """
    if len(times_s) < 3:
        return 0.0
    speed = np.linalg.norm(windowed_velocity(times_s, values, window_s), axis=1)
    return float(np.nanmax(speed)) if np.any(np.isfinite(speed)) else 0.0


def speed_noise(times_s: Floats, values: Floats, window_s: float = 0.15) -> float:
    """Root mean square of the windowed velocity that white measurement noise alone would give.

    The noise is what a sample differs from the line between its two neighbours by: its median,
    since a movement is no line where it turns or starts. 0 for a signal too short to tell.
    """
    if len(times_s) < MIN_SAMPLES:
        return 0.0
    steps = np.diff(times_s)
    share = (steps[:-1] / (steps[:-1] + steps[1:]))[:, None]
    bend = values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]
    bend /= np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    # the median of chi-square with one degree of freedom
    variance = float(np.sum(np.median(bend**2, axis=0))) / 0.4549
    # A line through n + 1 samples in equal steps over the window: the sum of their squared times.
    n = max(window_s / float(np.median(steps)), 1.0)
    return float(np.sqrt(variance * 12.0 * n / ((n + 1.0) * (n + 2.0)))) / window_s


def detect_onset(settings: OnsetSettings, times_s: Floats, values: Floats) -> float | None:
    """Time at which the movement began that is under way at the last sample, or None.

    Of the recent past: positions (T, P) of the observed DOFs at increasing times (T,).
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
    # Displacement and speed at one moment: the middle of the window the line was fitted to.
    window = times_s >= times_s[-1] - settings.window_s - 1e-9
    displacement = float(np.linalg.norm(values[window].mean(axis=0) - rest))
    backdate = 3.0 * displacement / max(float(speed[-1]), threshold)
    onset = times_s[window].mean() - np.fmin(backdate, settings.max_backdate_s)  # inf / inf: NaN
    return float(np.clip(onset, times_s[0], times_s[first]))


def at_rest(
    settings: OnsetSettings, times_s: Floats, values: Floats, rest_s: float | None = None
) -> bool:
    """Whether the signal has rested for `rest_s` (the settings' own if None) up to its end.

    The other arguments are those of `detect_onset`.
    """
    rest_s = settings.rest_s if rest_s is None else rest_s
    if len(times_s) < 4 or times_s[-1] - times_s[0] < rest_s:
        return False
    speed = np.linalg.norm(windowed_velocity(times_s, values, settings.window_s), axis=1)
    recent = speed[times_s >= times_s[-1] - rest_s]
    limit = settings.rest_share * settings.reference_speed
    return bool(np.all(recent < limit))


def is_slow(settings: OnsetSettings, velocity: Floats | None) -> bool:
    """Whether a signal with an `end_velocity` is as slow as `at_rest` asks of its last sample."""
    limit = settings.rest_share * settings.reference_speed
    return velocity is not None and bool(velocity @ velocity < limit**2)


def end_velocity(settings: OnsetSettings, times_s: Floats, values: Floats) -> Floats | None:
    """The last row of `windowed_velocity`, (P,); None where it is not known.

    Of the samples of the last `window_s`: values (T, P) at times (T,).
    """
    if len(times_s) < 3 or times_s[-1] - times_s[0] < 0.5 * settings.window_s:
        return None
    time = times_s - np.add.reduce(times_s) / len(times_s)
    return np.asarray((time @ values) / (time @ time), dtype=np.float64)


def first_onset(settings: OnsetSettings, times_s: Floats, values: Floats) -> float | None:
    """Onset of the first movement of a recording, found as it would have been online.

    Equals `detect_onset` called at every sample in turn, until it answers. Arguments as of
    `detect_onset`.
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
    """The first `first_onset` of some signals [s after `start_ns`]; None where none moves."""
    onsets = [
        first_onset(own, signal.seconds(start_ns), signal.values)
        for own, signal in zip(settings, signals, strict=True)
    ]
    return min((onset for onset in onsets if onset is not None), default=None)


def last_motion(settings: OnsetSettings, times_s: Floats, values: Floats) -> float:
    """Time at which the last movement of a recording ended; its first time if it never moved.

    The onset of the recording played backward, so that what is noise to the onset detector is noise
    here too. Not causal: for cutting recordings in training. Arguments as of `detect_onset`.
    """
    onset = first_onset(settings, -times_s[::-1], values[::-1])
    return float(times_s[0]) if onset is None else -onset

# SPDX-License-Identifier: Apache-2.0
"""Where in a recording the interaction begins and ends."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.signals.onset import (
    OnsetSettings,
    earliest_onset,
    last_motion,
    peak_speed,
    speed_noise,
)
from intent_recognition.signals.signal import MIN_SAMPLES, Signal
from intent_recognition.signals.units import SPATIAL_UNITS

END_MARGIN_S = 0.3
"""Rest after the last motion that belongs to the interaction [s]. Convention: primitives end at
rest."""
LONGEST_WINDOW_S = 1.2
"""Longest window of the speed [s]. Convention: an onset is found about half a window late."""
SLOWEST = 1e-6
"""Least reference speed [m/s or rad/s]; in other units in parts of the signal's range, per second.
Numerical safeguard: a signal that never moved has some."""
LEAST_RATE_HZ = (MIN_SAMPLES - 1) / LONGEST_WINDOW_S
"""Rate of a signal below which no onset is found in it [Hz]: `MIN_SAMPLES` in the longest
window."""


def onset_settings(recordings: Sequence[Sequence[Signal]]) -> tuple[OnsetSettings, ...]:
    """Thresholds for each signal from the median of its peak speeds over the recordings.

    Each recording has the same signals in the same order. The window in which the speed is measured
    is as long as the signal needs it to be: for `MIN_SAMPLES`, and for a movement so slow
    that its noise would count as moving: three standard deviations of it. Where no window is long
    enough, they are what counts, in the window that shows the movement best; of noise throughout,
    that is short.
    """
    n_signals = len(recordings[0])
    return tuple(_settings_of([signals[k] for signals in recordings]) for k in range(n_signals))


def least_reference(signals: Sequence[Signal], window_s: float) -> float:
    """Reference speed at which the noise of a signal does not count as moving, per second.

    Of its recordings, none of them empty, in windows of `window_s`.
    """
    noise = [speed_noise(s.seconds(int(s.stamps_ns[0])), s.values, window_s) for s in signals]
    return 3.0 * float(np.median(noise)) / OnsetSettings.start_share


def _settings_of(signals: Sequence[Signal]) -> OnsetSettings:
    """Thresholds for one signal from all of its recordings."""
    signals = [signal for signal in signals if signal.stamps_ns.size]
    slowest = _slowest(signals)
    periods = [np.median(np.diff(s.stamps_ns)) * 1e-9 for s in signals if s.stamps_ns.size > 1]
    period_s = float(np.median(periods)) if periods else 0.0
    shortest_s = max(OnsetSettings.window_s, (MIN_SAMPLES - 1) * period_s)
    shortest_s = window_s = min(shortest_s, LONGEST_WINDOW_S)
    best = 0.0, slowest, shortest_s
    while window_s <= LONGEST_WINDOW_S and signals:
        times_s = [signal.seconds(int(signal.stamps_ns[0])) for signal in signals]
        peaks = [peak_speed(t, s.values, window_s) for t, s in zip(times_s, signals, strict=True)]
        peak, least = float(np.median(peaks)), least_reference(signals, window_s)
        if peak >= least:
            best = 1.0, max(peak, slowest), window_s
            break
        best = max(best, (peak / least, least, window_s))
        window_s *= 2.0
    _, reference, window_s = best
    # Longer than a window is only partly filled: its slope is noisier until then.
    persistence_s = OnsetSettings.persistence_s * (window_s / OnsetSettings.window_s)
    return OnsetSettings(reference, window_s=window_s, persistence_s=persistence_s)


def _slowest(signals: Sequence[Signal]) -> float:
    """Least reference speed of a signal, per second."""
    if not signals or signals[0].unit in SPATIAL_UNITS:
        return SLOWEST
    values = np.concatenate([signal.values for signal in signals])
    size = max(np.ptp(values, axis=0).max(), 1e-9 * np.abs(values).max())  # rounding
    return SLOWEST * float(size or 1.0)


def movement_span(
    observed: Sequence[Signal],
    controlled: Sequence[Signal],
    observed_settings: Sequence[OnsetSettings],
    controlled_settings: Sequence[OnsetSettings],
    start_ns: int,
    end_ns: int,
) -> tuple[int, int]:
    """Start and end of the interaction within [start_ns, end_ns], in nanoseconds.

    It starts at the observed agent's onset, as the online detector would find it, and ends when
    the last of both agents has come to rest. A recording without a detected onset is kept whole.
    The settings say for each signal what counts as moving.
    """
    onset_s = earliest_onset(observed_settings, observed, start_ns)
    if onset_s is None:
        return start_ns, end_ns
    start = start_ns + round(onset_s * 1e9)
    signals, settings = (*observed, *controlled), (*observed_settings, *controlled_settings)
    last = [
        last_motion(own, signal.seconds(start_ns), signal.values)
        for own, signal in zip(settings, signals, strict=True)
        if signal.stamps_ns.size
    ]
    end = start_ns + round((max(last) + END_MARGIN_S) * 1e9) if last else end_ns
    return start, min(end, end_ns) if end > start else end_ns

# SPDX-License-Identifier: Apache-2.0
"""Find where the interaction begins and ends in a recording."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.signals.onset import (
    OnsetSettings,
    earliest_onset,
    latest_motion,
    peak_speed,
    speed_noise,
)
from intent_recognition.signals.signal import MIN_SAMPLES, Signal
from intent_recognition.signals.units import SPATIAL_UNITS

END_MARGIN_S = 0.3
"""Rest after the last motion that is part of the interaction [s], so that primitives end at rest.
"""
LONGEST_WINDOW_S = 1.2
"""Longest window for the speed [s]; an onset is detected about half a window late."""
SLOWEST = 1e-6
"""Least reference speed [m/s or rad/s; in other units, signal ranges per second], so that a signal
that never moved has a positive one."""
LEAST_RATE_HZ = (MIN_SAMPLES - 1) / LONGEST_WINDOW_S
"""Least rate of a signal at which an onset can be detected [Hz]: `MIN_SAMPLES` in the longest
window."""


def onset_settings(recordings: Sequence[Sequence[Signal]]) -> tuple[OnsetSettings, ...]:
    """Thresholds for each signal from the median of its peak speeds over the recordings.

    Each recording has the same signals in the same order. The window for the speed holds at least
    `MIN_SAMPLES` and is doubled until the start threshold is at least three standard deviations of
    the speed's noise. If no window suffices, the threshold is three standard deviations in the
    window with the highest ratio of peak speed to noise, a short one for pure noise.
    """
    n_signals = len(recordings[0])
    return tuple(_settings_of([signals[k] for signals in recordings]) for k in range(n_signals))


def least_reference(signals: Sequence[Signal], window_s: float) -> float:
    """Least reference speed at which a signal's noise does not count as moving, per second.

    `signals` are its recordings, none of them empty.
    """
    noise = [speed_noise(s.seconds(int(s.stamps_ns[0])), s.values, window_s) for s in signals]
    return 3.0 * float(np.median(noise)) / OnsetSettings.start_share


def _settings_of(signals: Sequence[Signal]) -> OnsetSettings:
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
    # Longer than the time for which a window is only partly filled and its slope noisier.
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
    """Start and end of the interaction within [start_ns, end_ns] [ns].

    It starts at the observed agent's onset, as detected online, and ends `END_MARGIN_S` after the
    last motion of either agent. A recording without a detected onset is kept whole. The settings
    are the thresholds of each signal.
    """
    onset_s = earliest_onset(observed_settings, observed, start_ns)
    if onset_s is None:
        return start_ns, end_ns
    start = start_ns + round(onset_s * 1e9)
    signals, settings = (*observed, *controlled), (*observed_settings, *controlled_settings)
    last_s = latest_motion(settings, signals, start_ns)
    end = end_ns if last_s is None else start_ns + round((last_s + END_MARGIN_S) * 1e9)
    return start, min(end, end_ns) if end > start else end_ns

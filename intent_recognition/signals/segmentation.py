# SPDX-License-Identifier: Apache-2.0
"""Where in a recording the interaction begins and ends."""

from collections.abc import Sequence

import numpy as np

from intent_recognition.signals.onset import OnsetSettings, first_onset, last_motion, peak_speed
from intent_recognition.signals.signal import Signal

END_MARGIN_S = 0.3
"""Rest after the last motion that belongs to the interaction [s].

Convention: a primitive ends at rest.
"""


def onset_settings(recordings: Sequence[Sequence[Signal]]) -> tuple[OnsetSettings, ...]:
    """Thresholds for each signal from the median of its peak speeds over the recordings.

    Args:
        recordings: the signals of each demonstration, the same ones in the same order.
    """
    references = []
    for index in range(len(recordings[0])):
        peaks = [
            peak_speed(signal.seconds(int(signal.stamps_ns[0])), signal.values)
            for signal in (signals[index] for signals in recordings)
            if signal.stamps_ns.size
        ]
        references.append(max(float(np.median(peaks)), 1e-6) if peaks else 1e-6)
    return tuple(OnsetSettings(reference_speed=reference) for reference in references)


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
    """
    onsets = []
    for signal, settings in zip(observed, observed_settings, strict=True):
        onset = first_onset(settings, signal.seconds(start_ns), signal.values)
        if onset is not None:
            onsets.append(onset)
    if not onsets:
        return start_ns, end_ns
    start = start_ns + round(min(onsets) * 1e9)
    last = []
    pairs = [*zip(observed, observed_settings, strict=True)]
    pairs += [*zip(controlled, controlled_settings, strict=True)]
    for signal, settings in pairs:
        if signal.stamps_ns.size:
            last.append(last_motion(settings, signal.seconds(start_ns), signal.values))
    end = start_ns + round((max(last) + END_MARGIN_S) * 1e9) if last else end_ns
    return start, min(end, end_ns) if end > start else end_ns

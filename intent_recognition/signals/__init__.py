# SPDX-License-Identifier: Apache-2.0
"""What was measured: signals, observations, demonstrations, and where movements begin and end."""

from intent_recognition.signals.demonstration import MIN_SAMPLES, Demonstration, Rejection
from intent_recognition.signals.observation import Observation, every_second, merge
from intent_recognition.signals.onset import OnsetSettings, at_rest, detect_onset, is_slow
from intent_recognition.signals.past import SignalPast
from intent_recognition.signals.segmentation import movement_span, onset_settings
from intent_recognition.signals.signal import Signal

__all__ = [
    "MIN_SAMPLES",
    "Demonstration",
    "Observation",
    "OnsetSettings",
    "Rejection",
    "Signal",
    "SignalPast",
    "at_rest",
    "detect_onset",
    "every_second",
    "is_slow",
    "merge",
    "movement_span",
    "onset_settings",
]

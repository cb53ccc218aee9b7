# SPDX-License-Identifier: Apache-2.0
"""Where a signal stops for a moment, so that another movement may have begun without a rest."""

import numpy as np

from intent_recognition.signals import OnsetSettings, Samples, end_velocity


class Stops:
    """Notices the momentary stops of a signal: where a hand turns back, or hesitates.

    Args:
        settings: what counts as moving, and for how long.
    """

    def __init__(self, settings: OnsetSettings):
        self._settings = settings
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._moved_ns = self._again_ns = 0

    def stopped_ns(self, samples: Samples) -> int | None:
        """Stamp of a stop after which the signal, just now, surely moves again.

        The middle between the last moment at which it moved before and the first at which it does
        again; of a longer stop, its last `max_backdate_s` count.

        Args:
            samples: of the last `window_s` at least.
        """
        settings, now_ns = self._settings, samples.last_ns
        velocity = end_velocity(settings, *samples.arrays(settings.window_s))
        if velocity is None:
            return None
        if np.linalg.norm(velocity) < settings.start_share * settings.reference_speed:
            self._again_ns = 0
            return None
        if not self._again_ns:
            self._again_ns = now_ns
        if now_ns - self._again_ns < settings.persistence_s * 1e9:
            return None
        stood_ns = self._again_ns - self._moved_ns
        first = not self._moved_ns
        self._moved_ns, again_ns = now_ns, self._again_ns
        if first or stood_ns <= 0:
            return None
        stood_ns = min(stood_ns, round(settings.max_backdate_s * 1e9))
        return again_ns - (stood_ns + round(settings.window_s * 1e9)) // 2

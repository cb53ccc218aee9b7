# SPDX-License-Identifier: Apache-2.0
"""Onset, stops and end of a movement, from the last seconds of all observed signals."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.filtering import TaskPosterior
from intent_recognition.signals import (
    LEAST_RATE_HZ,
    NEVER_NS,
    Observation,
    OnsetSettings,
    Samples,
    SignalPast,
    at_rest,
    detect_onset,
    end_velocity,
    is_slow,
)

HISTORY_S = 2.0
"""Length of the past in which the onset is searched [s]; more if the window of a signal's speed is
longer than the default (`past_s`)."""
FINISHED_PHASE = 0.99
"""Expected phase of the most probable task at which a movement at rest is over."""
PAUSE_S, PAUSE_SHARE = 1.5, 0.3
"""Shortest rest before its end that ends a movement [s], and the same for long tasks as a share of
the expected duration: longer than a hesitation."""
OVERTIME_S = 0.5
"""Longest time after its expected end for which a movement may go on [s]."""


class SparseSignal(NamedTuple):
    """A signal whose rate is too low to estimate its speed, so that no onset is detected."""

    group: int  # index of the observed signal
    rate_hz: float  # rate of its samples
    least_hz: float  # lowest rate for onset detection

    def warning(self, topic: str) -> str:
        """Warning about the signal on a topic, with the cure."""
        return (
            f"{topic} comes at {self.rate_hz:.2g} Hz, and no movement is found below"
            f" {self.least_hz:.2g} Hz: raise the tracker's rate, or train on recordings of this one"
        )


def past_s(settings: OnsetSettings) -> float:
    """Length of a signal's past that is kept for onset and rest detection [s].

    A speed is known after half its window, or after almost a whole one if samples are sparse, so
    1.2 times the excess of the window over the default is added.
    """
    return HISTORY_S + 1.2 * max(settings.window_s - OnsetSettings.window_s, 0.0)


class Stops:
    """Detects momentary stops of a signal, where a hand turns back or hesitates."""

    def __init__(self, settings: OnsetSettings):
        self._settings = settings
        self._moved_ns = self._again_ns = 0
        self._velocity: Floats | None = None
        self._dofs: tuple[int, ...] = ()

    def stopped_ns(
        self, now_ns: int, velocity: Floats | None, dofs: tuple[int, ...] = ()
    ) -> int | None:
        """Stamp of a stop, once the signal has moved again for `persistence_s`; else None.

        It is the middle between the last movement before the stop and the first one after it. Only
        the last `max_backdate_s` of a longer stop count.

        Args:
            now_ns: stamp of the signal's last sample.
            velocity: velocity at this sample, (m,); None if it is not known.
            dofs: DOFs of the velocity, (m,), empty for all; different DOFs are not compared.
        """
        settings = self._settings
        if velocity is None:
            return None
        before = self._velocity if dofs == self._dofs else None
        self._velocity, self._dofs = velocity, dofs
        limit = settings.start_share * settings.reference_speed
        if velocity @ velocity < limit**2:
            self._again_ns = 0
            return None
        if not self._again_ns or (before is not None and least_speed(before, velocity) < limit):
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


def least_speed(before: Floats, after: Floats) -> float:
    """Least norm on the line between two velocities (P,): a speed that a gap may hide."""
    change = after - before
    into = -float(before @ change) / max(float(change @ change), 1e-300)
    nearest = before + min(max(into, 0.0), 1.0) * change
    return sqrt(nearest @ nearest)


@dataclass
class _Moving:
    """Samples of DOFs that are measured together, and the velocity at the last sample."""

    settings: OnsetSettings
    samples: Samples

    @cached_property
    def velocity(self) -> Floats | None:
        return end_velocity(self.settings, *self.samples.arrays(self.settings.window_s))


def is_overdue(elapsed_s: float, posterior: TaskPosterior) -> bool:
    """Whether a movement goes on for more than `OVERTIME_S` after its task's expected end."""
    best = int(np.argmax(posterior.probabilities))
    late = elapsed_s > float(posterior.duration_s[best]) + OVERTIME_S
    return late and float(posterior.phase[best]) >= FINISHED_PHASE


class MotionDetector:
    """Detects onset, stops and end of movements from the last seconds of each signal.

    Attributes:
        settings: settings of onset detection of each signal.
        pasts: last seconds of each signal.
        waits_for_rest: whether all signals must rest before a movement can begin.
    """

    def __init__(self, groups: Sequence[int], settings: Sequence[OnsetSettings]):
        self.pasts = [
            SignalPast(size, past_s(own)) for size, own in zip(groups, settings, strict=True)
        ]
        self._now: list[list[_Moving]] = []
        self.waits_for_rest = False
        self.use(settings)

    def clear(self) -> None:
        """Forget everything."""
        self.waits_for_rest = False
        for past in self.pasts:
            past.clear()
        self._now.clear()
        self.forget_stops()

    def use(self, settings: Sequence[OnsetSettings]) -> None:
        """Switch to the settings of another library."""
        self.settings = settings
        self.forget_stops()
        for past, own in zip(self.pasts, settings, strict=True):
            past.keep(past_s(own))
        self._now.clear()

    def change_past(self, change: Callable[[Observation], Observation]) -> None:
        """Replace all past observations by what a function returns for them."""
        kept, waits = self.since(NEVER_NS), self.waits_for_rest
        changed = [change(observation) for observation in kept]
        if any(new is not old for new, old in zip(changed, kept, strict=True)):
            self.clear()
            for observation in changed:
                self.add(observation)
            self.waits_for_rest = waits

    def forget_stops(self) -> None:
        """Forget past stops and movements of the signals: a new movement begins."""
        self._stops = [Stops(own) for own in self.settings]

    def add(self, observation: Observation) -> None:
        """Take an observation that is not late."""
        self.pasts[observation.group].add(observation)
        for past in self.pasts:  # also of signals without new samples
            past.forget_before(observation.stamp_ns)
        self._now.clear()

    def too_sparse(self) -> SparseSignal | None:
        """First signal with too low a rate for onset detection; None if all rates suffice.

        A speed needs at least three samples within the window of the signal's settings.
        """
        for group, signal in enumerate(self._active()):
            for one in signal:
                least_hz = max(2.0 / one.settings.window_s, LEAST_RATE_HZ)
                steps_s = np.diff(one.samples.stamps_ns) * 1e-9
                if len(steps_s) and np.median(steps_s) * least_hz > 1.0 + 1e-6:
                    return SparseSignal(group, float(1.0 / np.median(steps_s)), least_hz)
        return None

    def find_onset_ns(self) -> int | None:
        """Stamp at which the movement under way began; None at rest.

        It also clears `waits_for_rest`, set by an overdue movement, once all signals have rested.
        """
        if self.waits_for_rest:
            self.waits_for_rest = not self._at_rest()
            return None
        onsets_ns = [
            one.samples.first_ns + round(onset * 1e9)
            for signal in self._active()
            for one in signal
            if (onset := detect_onset(one.settings, *one.samples.arrays())) is not None
        ]
        return min(onsets_ns, default=None)

    def stopped_ns(self) -> int | None:
        """Stamp of the earliest momentary stop after which a signal moves again, else None.

        Call it after every observation of a movement.
        """
        found = [
            stops.stopped_ns(moving[0].samples.last_ns, moving[0].velocity, moving[0].samples.dofs)
            for stops, moving in zip(self._stops, self._active(), strict=True)
            if moving
        ]
        return min((stop_ns for stop_ns in found if stop_ns is not None), default=None)

    def since(self, stamp_ns: int) -> list[Observation]:
        """All observations from a stamp on, in order."""
        found = [o for past in self.pasts for o in past.observations() if o.stamp_ns >= stamp_ns]
        return sorted(found, key=lambda o: (o.stamp_ns, o.group, o.derivative))

    def ends(self, elapsed_s: float, posterior: TaskPosterior) -> bool:
        """Whether the movement is over: done and at rest, in a long pause, or overdue.

        If it is overdue and not at rest, the detector then waits for rest.
        """
        best = int(np.argmax(posterior.probabilities))
        duration_s, phase = float(posterior.duration_s[best]), float(posterior.phase[best])
        if is_overdue(elapsed_s, posterior):
            self.waits_for_rest = not self._at_rest()
            return True
        if phase >= FINISHED_PHASE or best == len(posterior.probabilities) - 1:
            return self._at_rest()
        return self._at_rest(min(max(PAUSE_S, PAUSE_SHARE * duration_s), HISTORY_S - 0.1))

    def _at_rest(self, rest_s: float | None = None) -> bool:
        """Whether all signals have rested for `rest_s`, or for the time in their settings."""
        return all(
            is_slow(one.settings, one.velocity)
            and at_rest(one.settings, *one.samples.arrays(), rest_s)
            for signal in self._active()
            for one in signal
        )

    def _active(self) -> list[list[_Moving]]:
        """Recent samples and velocities of each signal, by jointly measured DOFs; cached."""
        if not self._now:
            self._now = [
                [_Moving(own, some) for some in past.active_samples(own.rest_s, own.window_s)]
                for own, past in zip(self.settings, self.pasts, strict=True)
            ]
        return self._now

# SPDX-License-Identifier: Apache-2.0
"""Check that observations are in the learned units; conversion of angles to the learned turn."""

from collections import deque
from collections.abc import Callable
from functools import cached_property

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.gaussian import Gaussian
from intent_recognition.promp import ContextModel, TaskLibrary, angle_starts, rollout
from intent_recognition.signals import (
    Known,
    Misfit,
    Observation,
    Signal,
    jumps,
    learned_misfit,
    other_units,
    time_misfit,
    turns_of,
    whole_turns,
)

N_JUDGED = 50
"""Number of unambiguous samples after which a signal's unit is no longer checked: half a second at
100 Hz. Samples that fit in another unit too, such as at the origin, do not count."""
N_STEPS = 5
"""Number of samples whose intervals are checked: one lost sample makes no difference."""
STD_LEARNED = 3.0
"""Half-width of the learned range about the mean movements, in standard deviations: 99.7 % of a
normal distribution."""


def context_misfit(model: ContextModel, values: Floats) -> Misfit | None:
    """Misfit of a context (M,), NaN for unknown numbers, with the learned units, or None."""
    spread = STD_LEARNED * np.sqrt(np.diagonal(model.covariance, axis1=1, axis2=2))
    for last, size in zip(np.cumsum(model.groups), model.groups, strict=True):
        dofs = np.arange(last - size, last)[np.isfinite(values[last - size : last])]
        if dofs.size:
            mean, names = model.mean[:, dofs], [model.names[k] for k in dofs]
            around = np.maximum(spread[:, dofs], 0.5 * np.abs(mean).max())  # few contexts are shown
            learned = Known((mean - around).min(axis=0), (mean + around).max(axis=0))
            if found := learned_misfit(names, model.units[dofs[0]], values[dofs], learned):
                return found
    return None


class FirstSamples:
    """Check of the units of the first samples of each observed signal.

    Attributes:
        misfit: misfit of the last checked sample; None if it was accepted.
    """

    def __init__(self, library: TaskLibrary):
        self._library = library
        self._left = dict.fromkeys(range(len(library.observed_groups)), N_JUDGED)
        self._stamps_ns = [deque[int](maxlen=N_STEPS) for _ in self._left]
        self.misfit: Misfit | None = None

    def refuse(self, observation: Observation) -> bool:
        """Whether a sample, or the times of the last samples, seem to be in another unit.

        Values must be finite. Velocities are not checked.
        """
        library, group, values = self._library, observation.group, observation.values
        if group not in self._left or observation.derivative:
            return False
        dofs = library.observed_dofs(group, observation.dofs)
        names, unit = [library.observed_names[k] for k in dofs], library.observed_units[dofs[0]]
        learned = Known(self._learned.lower[dofs], self._learned.upper[dofs])
        self.misfit = learned_misfit(names, unit, values, learned)
        self.misfit = self.misfit or self._late(observation, names[0], unit)
        if self.misfit is None and not other_units(unit, values, learned):
            self._left[group] -= 1
            if not self._left[group]:
                del self._left[group]
        return self.misfit is not None

    def _late(self, observation: Observation, name: str, unit: str) -> Misfit | None:
        """Misfit of the times of a signal's last samples, if it is certain."""
        stamps, stamp_ns = self._stamps_ns[observation.group], observation.stamp_ns
        if stamps and stamp_ns < stamps[-1]:
            stamps.clear()  # another clock, or DOFs with stamps of their own
        if not stamps or stamp_ns > stamps[-1]:
            stamps.append(stamp_ns)
        if len(stamps) < N_STEPS:
            return None
        found = time_misfit(Signal((name,), np.array(stamps), np.zeros((N_STEPS, 1)), unit))
        return found if found is not None and found.certain else None

    @cached_property
    def _learned(self) -> Known:
        """Learned ranges of the observed DOFs."""
        library, lower, upper = self._library, [], []
        for mean, covariance in zip(library.weight_mean, library.weight_covariance, strict=True):
            weights, phases = Gaussian(mean, covariance), np.linspace(0.0, 1.0, 21)
            course = rollout(library.basis, weights, phases, 1.0, library.noise_variance)
            lower.append((course.positions - STD_LEARNED * course.std).min(axis=0))
            upper.append((course.positions + STD_LEARNED * course.std).max(axis=0))
        return Known(np.min(lower, axis=0), np.max(upper, axis=0))


class ObservedTurns:
    """Removes whole turns from the angles in a stream of observations.

    The first value of an angle is moved to the turn nearest to the tasks' start. In later values,
    jumps by whole turns are removed (`signals.turns`), as in training.
    """

    _last: Floats

    def __init__(self, library: TaskLibrary):
        self._library, self._starts = library, _starts(library)
        self._turn = turns_of(library.units[: library.n_observed])
        self.forget()

    def change(self, library: TaskLibrary) -> Callable[[Observation], Observation]:
        """Switch to another library, whose tasks may begin in another turn.

        Returns:
            Function that moves an observation returned by `bring` so far into that turn.
        """
        before, self._library, self._starts = self._starts, library, _starts(library)
        by = whole_turns(np.nan_to_num(self._starts - before), self._turn)
        self._last = self._last + by

        def turned(observation: Observation) -> Observation:
            own = by[library.observed_dofs(observation.group, observation.dofs)]
            if observation.derivative or not own.any():
                return observation
            return observation._replace(values=observation.values + own)

        return turned

    def forget(self) -> None:
        """Begin with another stream."""
        self._last = self._starts.copy()
        self._seen = np.zeros(len(self._starts), dtype=bool)

    def bring(self, observation: Observation) -> Observation:
        """The observation with its angles in the turn of the last observations."""
        dofs = self._library.observed_dofs(observation.group, observation.dofs)
        if observation.derivative or np.all(np.isnan(self._starts[dofs])):
            return observation
        apart, turn = observation.values - self._last[dofs], self._turn[dofs]
        turns = np.where(self._seen[dofs], jumps(apart, turn), whole_turns(apart, turn))
        values = observation.values - turns
        angles = ~np.isnan(self._starts[dofs])
        self._last[dofs[angles]], self._seen[dofs] = values[angles], True
        return observation._replace(values=values)


def _starts(library: TaskLibrary) -> Floats:
    """Start of each observed angle, (P,); NaN for other DOFs."""
    starts = angle_starts(library)[: library.n_observed]
    return np.array([np.nan if at is None else at for at in starts])

# SPDX-License-Identifier: Apache-2.0
"""Observations as they come: in the units, and angles in the turn, that tasks were learned in."""

from collections import deque
from collections.abc import Callable

import numpy as np

from intent_recognition.array_types import Floats, Integers
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
"""Samples of a signal that can be in no other unit, after which its units are no longer judged.
Convention: half a second at 100 Hz. A hand that rests at the origin says nothing of its unit."""
N_STEPS = 5
"""Samples that times are judged by. Convention: one lost sample among them changes nothing."""
STD_LEARNED = 3.0
"""Standard deviations about the mean movements that count as learned. Convention: 99.7 % of a
normal distribution."""


def context_misfit(model: ContextModel, values: Floats) -> Misfit | None:
    """Why a context (M,), NaN where it is not known, is hardly in the learned units, if so."""
    spread = STD_LEARNED * np.sqrt(np.diagonal(model.covariance, axis1=1, axis2=2))
    for last, size in zip(np.cumsum(model.groups), model.groups, strict=True):
        dofs = np.arange(last - size, last)[np.isfinite(values[last - size : last])]
        if dofs.size:
            mean, names = model.mean[:, dofs], [model.names[k] for k in dofs]
            around = np.maximum(spread[:, dofs], 0.5 * np.abs(mean).max())  # few are shown
            learned = Known((mean - around).min(axis=0), (mean + around).max(axis=0))
            if found := learned_misfit(names, model.units[dofs[0]], values[dofs], learned):
                return found
    return None


class FirstSamples:
    """Judges the units of the first samples of each observed signal.

    Attributes:
        misfit: of the last sample that was refused.
    """

    def __init__(self, library: TaskLibrary):
        self._library = library
        self._judges: dict[int, _OfSignal] = {}
        self._left = dict.fromkeys(range(len(library.observed_groups)), N_JUDGED)
        self.misfit: Misfit | None = None

    def refuse(self, observation: Observation) -> bool:
        """Whether a sample, or the times of the last ones, are hardly in the learned units.

        It has finite positions, or their rates, which are not judged.
        """
        group = observation.group
        if group not in self._left or observation.derivative:
            return False
        if group not in self._judges:
            self._judges[group] = _OfSignal(self._library, group)
        self.misfit = self._judges[group].misfit(observation)
        if self.misfit is None and not self._judges[group].may_be_another(observation):
            self._left[group] -= 1
            if not self._left[group]:
                del self._left[group], self._judges[group]
        return self.misfit is not None


class _OfSignal:
    """Judges one signal."""

    def __init__(self, library: TaskLibrary, group: int):
        dofs = library.observed_dofs(group)
        self._names = np.array(library.observed_names)[dofs]
        self._unit = library.observed_units[dofs[0]]
        self._learned = _learned(library, dofs)
        self._stamps_ns = deque[int](maxlen=N_STEPS)

    def misfit(self, observation: Observation) -> Misfit | None:
        """Why it is hardly in the units that were learned; None where it may be."""
        names, learned = self._of(observation)
        found = learned_misfit(names, self._unit, observation.values, learned)
        return found or self._late(observation.stamp_ns, names)

    def may_be_another(self, observation: Observation) -> bool:
        """Whether its numbers could be places that were learned in another unit, too."""
        return bool(other_units(self._unit, observation.values, self._of(observation)[1]))

    def _of(self, observation: Observation) -> tuple[tuple[str, ...], Known]:
        """Names of the DOFs that were measured, and where they were learned."""
        rows = slice(None) if observation.dofs is None else list(observation.dofs)
        learned = Known(self._learned.lower[rows], self._learned.upper[rows])
        return tuple(self._names[rows].tolist()), learned

    def _late(self, stamp_ns: int, names: tuple[str, ...]) -> Misfit | None:
        """What is certainly wrong with the times of the last samples."""
        stamps = self._stamps_ns
        if stamps and stamp_ns < stamps[-1]:
            stamps.clear()  # another clock, or DOFs that have times of their own
        if not stamps or stamp_ns > stamps[-1]:
            stamps.append(stamp_ns)
        if len(stamps) < N_STEPS:
            return None
        found = time_misfit(Signal(names[:1], np.array(stamps), np.zeros((N_STEPS, 1)), self._unit))
        return found if found is not None and found.certain else None


def _learned(library: TaskLibrary, dofs: Integers) -> Known:
    """Where some observed DOFs were in the demonstrations."""
    lower, upper, phases = [], [], np.linspace(0.0, 1.0, 21)
    for mean, covariance in zip(library.weight_mean, library.weight_covariance, strict=True):
        course = rollout(
            library.basis, Gaussian(mean, covariance), phases, 1.0, library.noise_variance
        )
        positions, std = course.positions[:, dofs], course.std[:, dofs]
        lower.append((positions - STD_LEARNED * std).min(axis=0))
        upper.append((positions + STD_LEARNED * std).max(axis=0))
    return Known(np.min(lower, axis=0), np.max(upper, axis=0))


class ObservedTurns:
    """Takes whole turns out of the angles among the observations of one stream.

    The first value of an angle is brought nearest to where the tasks begin; later ones do not jump
    by whole turns (`signals.turns`), as in training.
    """

    _last: Floats

    def __init__(self, library: TaskLibrary):
        self._library, self._starts = library, _starts(library)
        self._turn = turns_of(library.units[: library.n_observed])
        self.forget()

    def change(self, library: TaskLibrary) -> Callable[[Observation], Observation]:
        """Go on with another library, whose tasks may begin in another turn.

        Returns:
            What takes the observations that were brought so far into that turn.
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
        """The observation, its angles in the turn of those before."""
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
    """Where each observed angle begins, (P,); NaN for other DOFs."""
    starts = angle_starts(library)[: library.n_observed]
    return np.array([np.nan if at is None else at for at in starts])

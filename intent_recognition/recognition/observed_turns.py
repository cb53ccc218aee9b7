# SPDX-License-Identifier: Apache-2.0
"""Observed angles, brought to the turn that the tasks were learned in."""

from collections.abc import Callable

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary, angle_starts
from intent_recognition.signals import Observation, jumps, turns_of, whole_turns


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

# SPDX-License-Identifier: Apache-2.0
"""The last seconds of one observed signal: what onset and rest are seen from, and what is late."""

from collections import deque
from collections.abc import Iterator
from itertools import takewhile

import numpy as np

from intent_recognition.promp.observations import Observation


class SignalPast:
    """Observations of one signal, those of the same DOFs together.

    A DOF that is missing for a while leaves a history of the others, from which onset and rest are
    told as well as can be; nothing is filled in.

    Args:
        n_dofs: of the signal.
        length_s: how much of the past is kept.
    """

    def __init__(self, n_dofs: int, length_s: float):
        self.n_dofs, self._length_ns = n_dofs, length_s * 1e9
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._histories: dict[tuple, deque[Observation]] = {}
        self._newest_ns = ([0] * self.n_dofs, [0] * self.n_dofs)
        self._late = [(0, 0), (0, 0)]

    def is_late(self, observation: Observation) -> bool:
        """Whether one of its DOFs was seen at that time, or after it, already.

        DOFs of one signal may come in different messages, and positions and velocities may: each
        has a time of its own.
        """
        newest_ns, dofs = self._newest_ns[observation.derivative], observation.dofs
        latest_ns = max(newest_ns) if dofs is None else max(newest_ns[k] for k in dofs)
        return observation.stamp_ns <= latest_ns

    def count_late(self, observation: Observation) -> int:
        """How many on end, in order among themselves, were late by now, with this one."""
        last_ns, count = self._late[observation.derivative]
        count = count + 1 if observation.stamp_ns > last_ns else 1
        self._late[observation.derivative] = (observation.stamp_ns, count)
        return count

    def add(self, observation: Observation) -> None:
        """Take an observation that is not late."""
        kind = (observation.dofs, observation.derivative)
        if kind not in self._histories:
            self._histories[kind] = deque()
        self._histories[kind].append(observation)
        newest_ns = self._newest_ns[observation.derivative]
        for dof in range(self.n_dofs) if observation.dofs is None else observation.dofs:
            newest_ns[dof] = observation.stamp_ns
        self._late[observation.derivative] = (0, 0)

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what is too long before a stamp."""
        emptied = []
        for kind, history in self._histories.items():
            while history and stamp_ns - history[0].stamp_ns > self._length_ns:
                history.popleft()
            if not history:
                emptied.append(kind)
        for kind in emptied:
            del self._histories[kind]

    def observations(self) -> Iterator[Observation]:
        """All of them, each history in order."""
        for history in self._histories.values():
            yield from history

    def speaking(self, rest_s: float) -> list[deque[Observation]]:
        """Histories of positions that tell how the signal moves now.

        Once other DOFs have been seen for so long, those that were seen before do not count.
        """
        found = [h for (_, derivative), h in self._histories.items() if not derivative]
        if len(found) < 2:
            return found
        newest_ns = max(history[-1].stamp_ns for history in found)
        return [h for h in found if newest_ns - h[-1].stamp_ns <= rest_s * 1e9]


def arrays(
    history: deque[Observation], last_s: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Times (T,) [s] and values (T, m) of a history, or of the last seconds of it."""
    if last_s is not None:
        oldest_ns = history[-1].stamp_ns - last_s * 1e9 - 1.0
        newest_first = takewhile(lambda o: o.stamp_ns >= oldest_ns, reversed(history))
        history = list(newest_first)[::-1]
    start = history[0].stamp_ns
    times = np.array([(o.stamp_ns - start) * 1e-9 for o in history])
    return times, np.array([o.values for o in history])

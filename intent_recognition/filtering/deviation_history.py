# SPDX-License-Identifier: Apache-2.0
"""What was believed of the phase deviations, one measurement after the other, to be smoothed."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Deviations(NamedTuple):
    """What was believed of some hypotheses' phase deviation, one measurement after the other.

    Attributes:
        times_s: of the n measurements after onset, (n,), ascending; a late one has the time of the
            one before.
        filtered: probability of each deviation given the measurements so far, (n, S, E).
        likelihood: what each measurement weighed the deviations with, (n, S, E).
    """

    times_s: NDArray[np.float64]
    filtered: NDArray[np.float64]
    likelihood: NDArray[np.float64]


class DeviationHistory:
    """The phase deviations of a movement under way, hypothesis by hypothesis."""

    def __init__(self) -> None:
        self._steps: list[tuple[float, NDArray[np.int64], NDArray[np.float64]]] = []

    def add(
        self,
        elapsed_s: float,
        hypotheses: NDArray[np.int64],
        deviation: NDArray[np.float64],
        likelihood: NDArray[np.float64],
    ) -> None:
        """Keep what some hypotheses (n,) believe after a measurement, (n, E) each.

        A hypothesis takes its measurements in the order of their arrival, whole tasks at a time.
        """
        self._steps.append((elapsed_s, hypotheses, np.stack([deviation, likelihood], axis=1)))

    def until_now(self, first: int, stop: int) -> Callable[[], Deviations]:
        """`of`, to be asked for later: of the measurements so far."""
        return partial(self.of, first, stop, len(self._steps))

    def of(self, first: int, stop: int, n_steps: int | None = None) -> Deviations:
        """Those of a range of hypotheses, which were conditioned together.

        Args:
            first: hypothesis.
            stop: the one after the last.
            n_steps: how many calls of `add` count, from the first on; None for all.
        """
        found = []
        for elapsed_s, hypotheses, both in self._steps[:n_steps]:
            inside = np.flatnonzero((hypotheses >= first) & (hypotheses < stop))
            if inside.size:
                order = inside[np.argsort(hypotheses[inside])]
                found.append((elapsed_s, both[order]))
        times_s = np.maximum.accumulate(np.array([elapsed_s for elapsed_s, _ in found]))
        if not found:
            empty = np.zeros((0, stop - first, 1))
            return Deviations(times_s, empty, empty)
        both = np.array([step for _, step in found])
        return Deviations(times_s, both[:, :, 0], both[:, :, 1])

# SPDX-License-Identifier: Apache-2.0
"""Observations of single signals, and several signals merged in the order of their stamps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.signals.signal import Signal


class Observation(NamedTuple):
    """One measurement of one signal of the observed agent.

    Attributes:
        stamp_ns: time of measurement.
        group: index of the observed signal.
        values: measured values of its DOFs, (m,), in their units.
        covariance: measurement covariance, (m, m), or None if the sender gave none.
        dofs: indices of the measured DOFs within the signal; None means all.
        derivative: whether the values are velocities, in units per second. They must be measured
            independently, not differentiated from positions that are observed as well.
    """

    stamp_ns: int
    group: int
    values: np.ndarray
    covariance: np.ndarray | None = None
    dofs: tuple[int, ...] | None = None
    derivative: bool = False

    def copied(self) -> Observation:
        """Copy with its own arrays, since a sender may reuse its buffer."""
        covariance = None if self.covariance is None else np.array(self.covariance)
        return self._replace(values=np.array(self.values), covariance=covariance)

    def measured(self) -> Observation | None:
        """Copy without the unmeasured DOFs, whose values are NaN; None if all are NaN."""
        rows = np.flatnonzero(~np.isnan(self.values))
        if rows.size == self.values.size:
            return self
        if not rows.size:
            return None
        return self._replace(
            values=self.values[rows],
            covariance=None if self.covariance is None else self.covariance[np.ix_(rows, rows)],
            dofs=tuple((rows if self.dofs is None else np.array(self.dofs)[rows]).tolist()),
        )


def merge(signals: Sequence[Signal]) -> Iterator[Observation]:
    """All samples of the signals, ordered by stamp and, for equal stamps, by signal."""
    stamps = np.concatenate([signal.stamps_ns for signal in signals])
    group = np.repeat(np.arange(len(signals)), [len(s.stamps_ns) for s in signals])
    row = np.concatenate([np.arange(len(s.stamps_ns)) for s in signals])
    for index in np.argsort(stamps, kind="stable"):
        signal = signals[group[index]]
        yield Observation(int(stamps[index]), int(group[index]), signal.values[row[index]])


def observations_of(
    groups: Sequence[int], stamps_ns: Integers, values: Floats
) -> Iterator[Observation]:
    """Split joint samples (T, P) of all signals into observations of each signal, without NaN.

    `groups` are the numbers of DOFs of each signal, whose sum is P.
    """
    edges = np.cumsum(groups)[:-1]
    for stamp_ns, row in zip(stamps_ns.tolist(), values, strict=True):
        for group, part in enumerate(np.split(row, edges)):
            observation = Observation(stamp_ns, group, part).measured()
            if observation is not None:
                yield observation


def every_second(observations: Sequence[Observation]) -> list[Observation]:
    """Every second observation of each signal, and the very last observation."""
    seen: dict[tuple, int] = {}
    kept = []
    for observation in observations[:-1]:
        kind = (observation.group, observation.dofs, observation.derivative)
        seen[kind] = seen.get(kind, 0) + 1
        if seen[kind] % 2:
            kept.append(observation)
    return [*kept, observations[-1]]

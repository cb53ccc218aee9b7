# SPDX-License-Identifier: Apache-2.0
"""The samples of several signals as one stream of observations, in the order of their stamps."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from intent_recognition.promp.bank import FilterBank, Hypotheses, condition_bank
from intent_recognition.promp.library import TaskLibrary
from intent_recognition.promp.signals import Signal


class Observation(NamedTuple):
    """One measurement of one signal of the observed agent.

    Attributes:
        stamp_ns: time of measurement.
        group: which observed signal it is.
        values: its DOFs, (m,), in their units.
        covariance: measurement covariance, (m, m), or None when the sender gave none.
    """

    stamp_ns: int
    group: int
    values: np.ndarray
    covariance: np.ndarray | None = None


def merge(signals: Sequence[Signal]) -> Iterator[Observation]:
    """All samples of the signals in the order of their stamps, ties in the order of signals."""
    stamps = np.concatenate([signal.stamps_ns for signal in signals])
    group = np.repeat(np.arange(len(signals)), [len(s.stamps_ns) for s in signals])
    row = np.concatenate([np.arange(len(s.stamps_ns)) for s in signals])
    for index in np.argsort(stamps, kind="stable"):
        signal = signals[group[index]]
        yield Observation(int(stamps[index]), int(group[index]), signal.values[row[index]])


def group_dofs(library: TaskLibrary, group: int) -> np.ndarray:
    """Indices of the observed DOFs of a signal, (m,)."""
    start = sum(library.observed_groups[:group])
    return np.arange(start, start + library.observed_groups[group])


def observe(
    library: TaskLibrary,
    hypotheses: Hypotheses,
    bank: FilterBank,
    observation: Observation,
    elapsed_s: float,
    interval_s: float,
) -> FilterBank:
    """Condition the bank on one observation of positions.

    Args:
        library: the learned tasks.
        hypotheses: the bank's grid.
        bank: the bank before.
        observation: what was measured.
        elapsed_s: time since onset.
        interval_s: time since this signal was last used, infinite at first.
    """
    dofs = group_dofs(library, observation.group)
    noise = library.noise_covariance(dofs, interval_s)
    if observation.covariance is not None:
        noise = noise + observation.covariance
    rows = library.basis.design_matrix(hypotheses.phase(elapsed_s))[:, None, :]
    return condition_bank(bank, dofs, rows, observation.values, noise)


class BankRun:
    """A bank that takes one observation after the other, and minds when each signal was last used.

    Args:
        library: the learned tasks.
        hypotheses: the bank's grid.
        bank: the bank at onset.
        onset_ns: stamp from which phases count.
    """

    def __init__(
        self, library: TaskLibrary, hypotheses: Hypotheses, bank: FilterBank, onset_ns: int
    ):
        self.library, self.hypotheses, self.onset_ns = library, hypotheses, onset_ns
        self.bank = bank
        self._last_ns: dict[int, int] = {}

    def observe(self, observation: Observation) -> None:
        """Condition the bank on an observation."""
        previous = self._last_ns.get(observation.group)
        interval = np.inf if previous is None else (observation.stamp_ns - previous) * 1e-9
        elapsed = (observation.stamp_ns - self.onset_ns) * 1e-9
        self.bank = observe(
            self.library, self.hypotheses, self.bank, observation, elapsed, interval
        )
        self._last_ns[observation.group] = observation.stamp_ns


def run_bank(
    library: TaskLibrary,
    hypotheses: Hypotheses,
    bank: FilterBank,
    observations: Iterable[Observation],
    onset_ns: int,
) -> FilterBank:
    """Condition the bank on a stretch of observations that begins at onset."""
    run = BankRun(library, hypotheses, bank, onset_ns)
    for observation in observations:
        run.observe(observation)
    return run.bank

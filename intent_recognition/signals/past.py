# SPDX-License-Identifier: Apache-2.0
"""The last seconds of one observed signal, for detecting onset, rest and late observations."""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.signals.observation import Observation

NEVER_NS = -(2**63)
"""Earlier than every stamp [ns]."""
CLOCK_RESET_AFTER = 50
"""Consecutive late samples of a signal, in order, after which its clock was set back. Convention:
half a second of a motion capture system at 100 Hz."""


class Samples(NamedTuple):
    """Stamps (T,) [ns], increasing, and values (T, m) of some DOFs of a signal, () for all."""

    stamps_ns: Integers
    values: Floats
    dofs: tuple[int, ...] = ()

    @property
    def first_ns(self) -> int:
        """Stamp of the oldest."""
        return int(self.stamps_ns[0])

    @property
    def last_ns(self) -> int:
        """Stamp of the newest."""
        return int(self.stamps_ns[-1])

    def arrays(self, last_s: float | None = None) -> tuple[Floats, Floats]:
        """Times from the first on (T,) [s] and values (T, m), or the last seconds of them."""
        first = 0
        if last_s is not None:
            oldest_ns = ceil(self.last_ns - last_s * 1e9 - 1.0)
            first = int(np.searchsorted(self.stamps_ns[:-1], oldest_ns))
        stamps_ns = self.stamps_ns[first:]
        return (stamps_ns - stamps_ns[0]) * 1e-9, self.values[first:]

    def longest_gap_s(self, last_s: float) -> float:
        """Longest time between two samples that reaches into the last seconds."""
        first = int(np.searchsorted(self.stamps_ns, self.last_ns - round(last_s * 1e9)))
        return float(np.max(np.diff(self.stamps_ns[max(first - 1, 0) :]), initial=0)) * 1e-9


class History:
    """Observations of the same DOFs in order, with their stamps and values as arrays."""

    def __init__(self, n_values: int):
        self._stamps_ns, self._values = np.empty(256, np.int64), np.empty((256, n_values))
        self._kept: list[Observation] = []
        self._first = 0

    def __len__(self) -> int:
        return len(self._kept) - self._first

    @property
    def observations(self) -> list[Observation]:
        """All of them."""
        return self._kept[self._first :]

    def append(self, observation: Observation) -> None:
        """Take one more."""
        at = len(self._kept)
        if at == len(self._stamps_ns):
            at = self._make_room()
        self._stamps_ns[at], self._values[at] = observation.stamp_ns, observation.values
        self._kept.append(observation)

    def forget_before(self, stamp_ns: int, length_ns: float) -> None:
        """Drop what is longer than that before a stamp."""
        while len(self) and stamp_ns - self._kept[self._first].stamp_ns > length_ns:
            self._first += 1

    @property
    def samples(self) -> "Samples":
        """Their stamps and values."""
        kept = slice(self._first, len(self._kept))
        return Samples(self._stamps_ns[kept], self._values[kept])

    def _make_room(self) -> int:
        """Move everything to the front, and double the memory where that gains little."""
        first, n = self._first, len(self)
        self._kept, self._first = self._kept[first:], 0
        size = len(self._stamps_ns) * (2 if 2 * n > len(self._stamps_ns) else 1)
        for name in ("_stamps_ns", "_values"):
            old = getattr(self, name)
            new = np.empty((size, *old.shape[1:]), old.dtype)
            new[:n] = old[first : first + n]
            setattr(self, name, new)
        return n


class LateSamples:
    """Counts consecutive late samples of a signal that are in order among themselves."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """One has come that was not late."""
        self._last_ns, self._n = NEVER_NS, 0

    def count(self, stamp_ns: int) -> int:
        """Number of them, with this one."""
        self._n = self._n + 1 if stamp_ns > self._last_ns else 1
        self._last_ns = stamp_ns
        return self._n


class SignalPast:
    """Observations of one signal, those of the same DOFs together, of the last `length_s`.

    Onset and rest are detected from each DOF at the times at which it was measured; nothing is
    filled in.
    """

    def __init__(self, n_dofs: int, length_s: float):
        self.n_dofs = n_dofs
        self.keep(length_s)
        self._last_valid = b""
        self.clear()

    def keep(self, length_s: float) -> None:
        """Keep so much of the past from now on [s]."""
        self._length_ns = length_s * 1e9

    def clear(self) -> None:
        """Forget everything."""
        self._histories: dict[tuple, History] = {}
        self._newest_ns = ([NEVER_NS] * self.n_dofs, [NEVER_NS] * self.n_dofs)
        self._late = LateSamples(), LateSamples()

    def is_late(self, observation: Observation) -> bool:
        """Whether one of its DOFs was seen at that time, or after it, already.

        DOFs of one signal may come in different messages, and positions and velocities may: each
        has a time of its own.
        """
        newest_ns, dofs = self._newest_ns[observation.derivative], observation.dofs
        latest_ns = max(newest_ns) if dofs is None else max(newest_ns[k] for k in dofs)
        return observation.stamp_ns <= latest_ns

    def count_late(self, observation: Observation) -> int:
        """Number of consecutive late observations in order among themselves, with this one."""
        return self._late[observation.derivative].count(observation.stamp_ns)

    def add(self, observation: Observation) -> None:
        """Take an observation that is not late."""
        kind = (observation.dofs, observation.derivative)
        if kind not in self._histories:
            self._histories[kind] = History(len(observation.values))
        self._histories[kind].append(observation)
        newest_ns = self._newest_ns[observation.derivative]
        for dof in range(self.n_dofs) if observation.dofs is None else observation.dofs:
            newest_ns[dof] = observation.stamp_ns
        self._late[observation.derivative].forget()

    def is_covariance(self, covariance: Floats) -> bool:
        """Whether a matrix (m, m) is a valid covariance; the last valid one is known."""
        content = covariance.tobytes()
        if content != self._last_valid:
            if not is_covariance(covariance):
                return False
            self._last_valid = content
        return True

    def forget_before(self, stamp_ns: int) -> None:
        """Drop what is too long before a stamp."""
        for history in self._histories.values():
            history.forget_before(stamp_ns, self._length_ns)
        for kind in [kind for kind, history in self._histories.items() if not len(history)]:
            del self._histories[kind]

    def observations(self) -> Iterator[Observation]:
        """All of them, each history in order."""
        for history in self._histories.values():
            yield from history.observations

    def active_samples(self, rest_s: float, window_s: float) -> list[Samples]:
        """Positions that tell how the signal moves now; DOFs measured together stay together.

        A DOF does not count that was last seen `rest_s` before the newest observation, nor, beside
        others, one with gaps in these seconds in which half the window of its speed is missing.
        """
        found = [(dofs, h.samples) for (dofs, d), h in self._histories.items() if not d]
        if len(found) < 2:
            return [samples._replace(dofs=tuple(dofs or ())) for dofs, samples in found]
        newest_ns = max(samples.last_ns for _, samples in found)
        together: dict[tuple[int, ...], list[int]] = {}
        for dof in range(self.n_dofs):
            seen = tuple(k for k, (dofs, _) in enumerate(found) if dofs is None or dof in dofs)
            together.setdefault(seen, []).append(dof)
        together.pop((), None)
        joined = [
            _join([_columns(*found[k], columns) for k in seen])._replace(dofs=tuple(columns))
            for seen, columns in together.items()
        ]
        active = [s for s in joined if newest_ns - s.last_ns <= rest_s * 1e9]
        return [s for s in active if s.longest_gap_s(rest_s) <= 0.5 * window_s] or active


def _columns(dofs: Sequence[int] | None, samples: Samples, wanted: list[int]) -> Samples:
    """The columns of some DOFs in samples of others (None: of all)."""
    columns = wanted if dofs is None else [dofs.index(dof) for dof in wanted]
    return Samples(samples.stamps_ns, samples.values[:, columns])


def _join(parts: Sequence[Samples]) -> Samples:
    """Samples of the same DOFs in the order of their stamps."""
    stamps_ns = np.concatenate([part.stamps_ns for part in parts])
    order = np.argsort(stamps_ns, kind="stable")
    return Samples(stamps_ns[order], np.concatenate([part.values for part in parts])[order])


def is_covariance(matrix: Floats) -> bool:
    """Whether a matrix is finite, symmetric and positive semidefinite."""
    if not np.all(np.isfinite(matrix)):
        return False
    if np.abs(matrix - matrix.T).max(initial=0.0) > 1e-6 * np.abs(matrix).max(initial=0.0):
        return False
    eigenvalues = np.linalg.eigvalsh(matrix)
    return bool(eigenvalues[0] >= -1e-9 * abs(eigenvalues[-1]))

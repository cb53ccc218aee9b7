# SPDX-License-Identifier: Apache-2.0
"""Keep the last seconds of an observed signal to detect onset, rest and late observations."""

from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.signals.observation import Observation

NEVER_NS = -(2**63)
"""A stamp before all others [ns]."""
CLOCK_RESET_AFTER = 50
"""Number of consecutive late but ordered samples that show that a signal's clock was set back: half
a second of a motion capture system at 100 Hz."""


class Samples(NamedTuple):
    """Increasing stamps (T,) [ns] and values (T, m) of some DOFs of a signal, () for all DOFs."""

    stamps_ns: Integers
    values: Floats
    dofs: tuple[int, ...] = ()

    @property
    def first_ns(self) -> int:
        """Stamp of the oldest sample [ns]."""
        return int(self.stamps_ns[0])

    @property
    def last_ns(self) -> int:
        """Stamp of the newest sample [ns]."""
        return int(self.stamps_ns[-1])

    def arrays(self, last_s: float | None = None) -> tuple[Floats, Floats]:
        """Times since the first sample (T,) [s] and values (T, m), of the last `last_s` or all."""
        first = 0
        if last_s is not None:
            oldest_ns = ceil(self.last_ns - last_s * 1e9 - 1.0)
            first = int(np.searchsorted(self.stamps_ns[:-1], oldest_ns))
        stamps_ns = self.stamps_ns[first:]
        return (stamps_ns - stamps_ns[0]) * 1e-9, self.values[first:]

    def longest_gap_s(self, last_s: float) -> float:
        """Longest time between two samples that reaches into the last `last_s` [s]."""
        first = int(np.searchsorted(self.stamps_ns, self.last_ns - round(last_s * 1e9)))
        return float(np.max(np.diff(self.stamps_ns[max(first - 1, 0) :]), initial=0)) * 1e-9


class History:
    """Ordered observations of the same DOFs, with their stamps and values as arrays."""

    def __init__(self, n_values: int):
        self._stamps_ns, self._values = np.empty(256, np.int64), np.empty((256, n_values))
        self._kept: list[Observation] = []
        self._first = 0

    def __len__(self) -> int:
        return len(self._kept) - self._first

    @property
    def observations(self) -> list[Observation]:
        """All kept observations."""
        return self._kept[self._first :]

    def append(self, observation: Observation) -> None:
        """Append an observation, which must be newer than the others."""
        at = len(self._kept)
        if at == len(self._stamps_ns):
            at = self._make_room()
        self._stamps_ns[at], self._values[at] = observation.stamp_ns, observation.values
        self._kept.append(observation)

    def forget_before(self, stamp_ns: int, length_ns: float) -> None:
        """Drop observations more than `length_ns` before a stamp."""
        while len(self) and stamp_ns - self._kept[self._first].stamp_ns > length_ns:
            self._first += 1

    @property
    def samples(self) -> "Samples":
        """Stamps and values of the kept observations."""
        kept = slice(self._first, len(self._kept))
        return Samples(self._stamps_ns[kept], self._values[kept])

    def _make_room(self) -> int:
        """Move everything to the front, and double the memory if it is more than half full."""
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
        """Start counting anew, after a sample that was not late."""
        self._last_ns, self._n = NEVER_NS, 0

    def count(self, stamp_ns: int) -> int:
        """Count a late sample; returns the number of consecutive ones."""
        self._n = self._n + 1 if stamp_ns > self._last_ns else 1
        self._last_ns = stamp_ns
        return self._n


class SignalPast:
    """Observations of one signal in the last `length_s`, grouped by the measured DOFs.

    Onset and rest are detected for each DOF from its own samples; nothing is interpolated.
    """

    def __init__(self, n_dofs: int, length_s: float):
        self.n_dofs = n_dofs
        self.keep(length_s)
        self._last_valid = b""
        self.clear()

    def keep(self, length_s: float) -> None:
        """Set the length of the past that is kept [s]."""
        self._length_ns = length_s * 1e9

    def clear(self) -> None:
        """Forget everything."""
        self._histories: dict[tuple, History] = {}
        self._newest_ns = ([NEVER_NS] * self.n_dofs, [NEVER_NS] * self.n_dofs)
        self._late = LateSamples(), LateSamples()

    def is_late(self, observation: Observation) -> bool:
        """Whether one of its DOFs was already observed at the same time or later.

        DOFs of one signal may come in different messages, as may positions and velocities, so each
        has its own latest time.
        """
        newest_ns, dofs = self._newest_ns[observation.derivative], observation.dofs
        latest_ns = max(newest_ns) if dofs is None else max(newest_ns[k] for k in dofs)
        return observation.stamp_ns <= latest_ns

    def count_late(self, observation: Observation) -> int:
        """Count a late observation; returns the number of consecutive ordered late ones."""
        return self._late[observation.derivative].count(observation.stamp_ns)

    def add(self, observation: Observation) -> None:
        """Add an observation that is not late."""
        kind = (observation.dofs, observation.derivative)
        if kind not in self._histories:
            self._histories[kind] = History(len(observation.values))
        self._histories[kind].append(observation)
        newest_ns = self._newest_ns[observation.derivative]
        for dof in range(self.n_dofs) if observation.dofs is None else observation.dofs:
            newest_ns[dof] = observation.stamp_ns
        self._late[observation.derivative].forget()

    def is_covariance(self, covariance: Floats) -> bool:
        """Whether a matrix (m, m) is a valid covariance; the last valid matrix is cached."""
        content = covariance.tobytes()
        if content != self._last_valid:
            if not is_covariance(covariance):
                return False
            self._last_valid = content
        return True

    def forget_before(self, stamp_ns: int) -> None:
        """Drop observations more than `length_s` before a stamp."""
        for history in self._histories.values():
            history.forget_before(stamp_ns, self._length_ns)
        for kind in [kind for kind, history in self._histories.items() if not len(history)]:
            del self._histories[kind]

    def observations(self) -> Iterator[Observation]:
        """All kept observations, ordered within each group of DOFs."""
        for history in self._histories.values():
            yield from history.observations

    def active_samples(self, rest_s: float, window_s: float) -> list[Samples]:
        """Positions that show how the signal moves now, grouped by DOFs measured together.

        A DOF last observed more than `rest_s` before the newest observation is left out. If others
        remain, so is a DOF with a gap in the last `rest_s` longer than half of `window_s`.
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
    """Samples of the `wanted` DOFs only, from samples of `dofs` (None for all)."""
    columns = wanted if dofs is None else [dofs.index(dof) for dof in wanted]
    return Samples(samples.stamps_ns, samples.values[:, columns])


def _join(parts: Sequence[Samples]) -> Samples:
    """Merge samples of the same DOFs in the order of their stamps."""
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

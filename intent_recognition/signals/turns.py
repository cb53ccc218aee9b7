# SPDX-License-Identifier: Apache-2.0
"""Remove whole-turn jumps from angles, and bring the angles of several recordings to one turn.

Drivers wrap an angle to one turn, so that it jumps by 2 pi, and a joint that turns more than once
may begin recordings in different turns. Only whole turns are added, so that angles are unchanged on
the circle.
"""

from collections.abc import Sequence

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.signals.signal import Signal

TURNS = {"rad": 2.0 * np.pi, "deg": 360.0}
"""A whole turn in each unit of angles."""


def turns_of(units: Sequence[str]) -> Floats:
    """A whole turn in the unit of each DOF (d,), NaN for DOFs that are not angles."""
    return np.array([TURNS.get(unit, np.nan) for unit in units])


def whole_turns(difference: Floats, turn: Floats | float) -> Floats:
    """Differences of angles rounded to whole turns, (...); zero for DOFs that are not angles."""
    return np.nan_to_num(turn * np.round(difference / turn))


def jumps(difference: Floats, turn: Floats | float) -> Floats:
    """The whole turns by which angles jump between successive samples, (...); zero for no jump."""
    turns = whole_turns(difference, turn)
    # angles may move by up to a radian between samples
    return np.where(np.abs(difference - turns) < turn / TURNS["rad"], turns, 0.0)


def continuous(signal: Signal) -> tuple[Signal, tuple[str, ...]]:
    """The signal without jumps by whole turns, and the names of the DOFs that jumped."""
    if signal.unit not in TURNS or len(signal.values) < 2:
        return signal, ()
    turns = np.cumsum(jumps(np.diff(signal.values, axis=0), TURNS[signal.unit]), axis=0)
    wrapped = np.any(turns, axis=0)
    if not wrapped.any():
        return signal, ()
    values = signal.values.copy()
    values[1:] -= turns
    names = tuple(name for name, jumped in zip(signal.names, wrapped, strict=True) if jumped)
    return Signal(signal.names, signal.stamps_ns, values, signal.unit), names


def turn_reference(angles: Floats, turn: float = TURNS["rad"]) -> float:
    """The middle of angles (n,) on the circle, opposite to the widest gap between them.

    Bringing angles within half a turn of it thus separates them at the widest gap. The middle is in
    the turn that contains most of the given angles.
    """
    around = np.sort(np.mod(angles, turn))
    gaps = np.diff(around, append=around[0] + turn)
    widest = int(np.argmax(gaps))
    middle = around[widest] + 0.5 * gaps[widest] + 0.5 * turn
    turns, counts = np.unique(whole_turns(angles - middle, turn), return_counts=True)
    return float(middle + turns[np.argmax(counts)])


def begin_near(
    signals: Sequence[Signal], start_ns: int, references: Sequence[float | None]
) -> tuple[Signal, ...]:
    """Shift each angle of an agent's signals by whole turns to begin nearest to its reference.

    There is one reference for each DOF of all signals, None for DOFs that are not angles.
    """
    found, first = [], 0
    for signal in signals:
        own = references[first : first + len(signal.names)]
        first += len(signal.names)
        if any(reference is not None for reference in own) and len(signal.values):
            begin = first_values(signal, start_ns)
            near = [b if r is None else r for b, r in zip(begin, own, strict=True)]
            turns = whole_turns(begin - near, TURNS[signal.unit])
            if turns.any():
                signal = Signal(signal.names, signal.stamps_ns, signal.values - turns, signal.unit)
        found.append(signal)
    return tuple(found)


def first_values(signal: Signal, start_ns: int) -> Floats:
    """The signal's first sample at or after a stamp, or else its last sample, (d,)."""
    row = int(np.searchsorted(signal.stamps_ns, start_ns))
    return signal.values[min(row, len(signal.values) - 1)]

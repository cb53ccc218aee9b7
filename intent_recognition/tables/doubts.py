# SPDX-License-Identifier: Apache-2.0
"""Whether what was read of a table can be in its units, and on one clock."""

from collections.abc import Iterator, Sequence

import numpy as np

from intent_recognition.signals import Signal, misfit, time_misfit
from intent_recognition.tables.imported import EntrySamples

MANY_DROPPED = 0.1
"""Share of the rows without a time of their own that is named. Convention."""


def certain_misfit(samples: Sequence[EntrySamples]) -> str | None:
    """Why times or values are certainly in another unit than the map says; None if not."""
    for part in samples:
        seen = np.all(np.isfinite(part.values), axis=1)
        values = part.values[seen]
        signal = Signal(part.entry.names, part.stamps_ns[seen], values, part.entry.unit)
        found = time_misfit(signal)
        if found is not None and found.certain:
            return f"{found.reason} Say under time in the map: unit, or rate."
        found = None if part.entry.orientation else misfit(signal)
        if found is not None and found.certain:
            return _never_measured(signal) or f"{found.reason} Say in the map: columns_unit."
    return None


def doubts(parts: Sequence[tuple[EntrySamples, int]]) -> Iterator[str]:
    """What is odd about samples, and how many of their rows were dropped; they are taken."""
    for part, dropped in parts:
        rows = dropped + part.stamps_ns.size
        if dropped > MANY_DROPPED * rows:
            yield (
                f"{dropped} of {rows} rows of {part.entry.topic} are dropped, whose times are"
                " missing or not later than before. Likely a clock that went back or repeats: see"
                " under time in the map."
            )
        seen = np.all(np.isfinite(part.values), axis=1)
        values = part.values[seen]
        if part.entry.unit == "rad":  # reading takes wrapped angles as continuous, too
            values = np.unwrap(values, axis=0)
        signal = Signal(part.entry.names, part.stamps_ns[seen], values, part.entry.unit)
        found = None if part.entry.orientation else misfit(signal)
        if found is not None:
            yield f"taken as it is, but {found.reason} Say in the map: columns_unit."


def _never_measured(signal: Signal) -> str:
    """Whether some rows have one number in all columns, without which nothing is odd."""
    same = np.ptp(signal.values, axis=1) == 0.0
    if signal.values.shape[1] < 2 or len(set(signal.values[same, 0].tolist())) != 1:
        return ""
    rest = Signal(signal.names, signal.stamps_ns[~same], signal.values[~same], signal.unit)
    if misfit(rest) is not None:
        return ""
    return (
        f"{signal.values[same][0, 0]:.6g} {signal.unit} stands in every column of {int(same.sum())}"
        " rows. Likely nothing was measured there: leave these cells empty."
    )

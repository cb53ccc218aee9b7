# SPDX-License-Identifier: Apache-2.0
"""Check that the values of a table can be in their units, and its times on one clock."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from intent_recognition.demonstrations import DofSpec, iter_demonstrations, settle_orientations
from intent_recognition.signals import (
    LONGEST_PERIOD_S,
    Misfit,
    Rejection,
    Signal,
    misfit,
    recording_doubts,
    scene_misfit,
    sparse,
    time_misfit,
    zeros,
)
from intent_recognition.tables.imported import EntrySamples

STILL_M = 0.002
"""Extent of a movement below which its unit is doubted [m]: a reach of 2 m, divided by 1000."""

UNIT_NORM = 0.1
"""Largest deviation of a quaternion's norm from 1; it allows for numbers with one decimal."""


@dataclass(frozen=True)
class Doubt(Rejection):
    """Oddity of a recording that is imported nevertheless."""


def certain_misfit(samples: Sequence[EntrySamples]) -> str | None:
    """Why times or values are certainly in another unit than the map says; else None."""
    for part in samples:
        seen = np.all(np.isfinite(part.values), axis=1)
        values = part.values[seen]
        signal = Signal(part.entry.message_names, part.stamps_ns[seen], values, part.entry.unit)
        found = time_misfit(signal)
        if found is not None and found.certain:
            return f"{found.reason} Say under time in the map: unit, or rate."
        if part.entry.orientation:
            norms = np.linalg.norm(values, axis=1)
            norm = float(np.median(norms[norms > 0.0])) if norms.any() else 1.0
            if abs(norm - 1.0) > UNIT_NORM:
                said = f"{signal.names[0]}, ... have a norm of {norm:.3g}: no unit quaternion."
                return f"{said} Name its x, y, z and w in the map: columns."
            continue
        found = misfit(signal)
        if found is not None and found.certain:
            return _with_cure(found)
    return None


def doubts(parts: Sequence[tuple[EntrySamples, int]]) -> Iterator[str]:
    """Oddities of samples, each given with its number of dropped rows; they are still imported."""
    yield from _two_clocks([part for part, _ in parts if not part.entry.context])
    for part, dropped in parts:
        rows = dropped + part.stamps_ns.size
        if dropped > 0.1 * rows:
            yield (
                f"{dropped} of {rows} rows of {part.entry.topic} are dropped, whose times are"
                " missing or not later than before. Likely a clock that went back or repeats, or"
                " times that lost digits: see under time in the map."
            )
        seen = np.all(np.isfinite(part.values), axis=1)
        steps_s = np.diff(part.stamps_ns) * 1e-9
        # the longest period that can be learned, or 50 steps, half a second at 100 Hz
        if steps_s.size and steps_s.max() > max(LONGEST_PERIOD_S, 50 * np.median(steps_s)):
            yield (
                f"no sample of {part.entry.topic} for {steps_s.max():.4g} s. Likely a clock that"
                " jumped, or several demonstrations: cut them by segments in the map."
            )
        values = part.values[seen]
        if part.entry.unit == "rad":  # reading the bag also unwraps angles
            values = np.unwrap(values, axis=0)
        signal = Signal(part.entry.message_names, part.stamps_ns[seen], values, part.entry.unit)
        judge = scene_misfit if part.entry.context else misfit
        found = None if part.entry.orientation else judge(signal)
        if found is not None:
            yield _with_cure(found)
        if not part.entry.context:
            yield from (*zeros(signal), *sparse(signal))
        extent = float(np.ptp(values, axis=0).max(initial=0.0)) if values.size else 0.0
        if part.entry.unit == "m" and not part.entry.context and 0.0 < extent < STILL_M:
            yield (
                f"{part.entry.topic} moves over {1e3 * extent:.3g} mm. Likely metres that are"
                " called millimetres or centimetres: say in the map columns_unit: m."
            )


def _two_clocks(parts: Sequence[EntrySamples]) -> Iterator[str]:
    """Report entries without any time in common with the first."""
    for part in parts[1:]:
        first, second = sorted((parts[0], part), key=lambda one: int(one.stamps_ns[0]))
        gap_s = (second.stamps_ns[0] - first.stamps_ns[-1]) * 1e-9
        if gap_s > 0.0:
            yield (
                f"{second.entry.topic} begins {gap_s:.3g} s after the end of {first.entry.topic}."
                " Likely two clocks: see under time in the map."
            )


def bag_doubts(name: str, path: Path, dofs: DofSpec) -> Iterator[Doubt]:
    """Oddities of a ROS recording, or why it cannot be learned from; it is still imported."""
    for read in iter_demonstrations(path, settle_orientations(dofs, path)):
        odd = [read.reason] if isinstance(read, Rejection) else recording_doubts(read)
        yield from (Doubt(name, "", 0, reason) for reason in odd)


def _with_cure(found: Misfit) -> str:
    known = np.isfinite(found.factor)
    return f"{found.reason} Say in the map: columns_unit." if known else found.reason

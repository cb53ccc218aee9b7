# SPDX-License-Identifier: Apache-2.0
"""Samples of degrees of freedom over time as they were measured, irregular and with gaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats, Integers, brief, settle
from intent_recognition.errors import ArgumentError, ShapeError

POSITION_FIELDS = tuple(f"pose.position.{axis}" for axis in "xyz")
ORIENTATION_FIELDS = tuple(f"pose.orientation.{axis}" for axis in "xyzw")
POSE_FIELDS = (*POSITION_FIELDS, *ORIENTATION_FIELDS)
"""Fields of a PoseStamped message, in the order of the columns of pose arrays."""

MIN_SAMPLES = 4
"""Fewest samples of a DOF for fitting weights: three determine the curvature that ridge regression
penalises, and a fourth leaves a residual."""


@brief
@dataclass(frozen=True)
class Signal:
    """Samples of the DOFs of one topic, without interpolation in gaps.

    Attributes:
        names: names of the d DOFs.
        stamps_ns: time of measurement of each sample, int64 (T,), strictly increasing.
        values: float64 (T, d), in `unit`.
        unit: unit of all d DOFs, usually "m" or "rad".

    Raises:
        ShapeError: the arrays do not fit each other or the names.
        ArgumentError: stamps do not increase, or a value is not finite.
    """

    names: tuple[str, ...]
    stamps_ns: Integers
    values: Floats
    unit: str

    def __post_init__(self) -> None:
        stamps = np.array(self.stamps_ns, dtype=np.int64)
        values = np.array(self.values, dtype=np.float64)
        if values.shape != (stamps.size, len(self.names)):
            raise ShapeError.about(
                "values",
                f"shape ({stamps.size}, {len(self.names)}): one row a stamp, one column a name",
                values.shape,
                "Stack the samples in time, then by DOF.",
            )
        if stamps.size > 1 and np.min(np.diff(stamps)) <= 0:
            at = int(np.argmin(np.diff(stamps)))
            got = f"{stamps[at]} then {stamps[at + 1]}"
            cure = "Sort the samples and drop duplicates."
            raise ArgumentError.about("stamps_ns", "strictly increasing stamps", got, cure)
        if not np.all(np.isfinite(values)):
            cure = "Leave such samples out."
            raise ArgumentError.about("values", "finite numbers", "NaN or infinity", cure)
        settle(self, stamps_ns=stamps, values=values)

    def seconds(self, start_ns: int) -> Floats:
        """Times of the samples in seconds after `start_ns`, (T,)."""
        return (self.stamps_ns - np.int64(start_ns)) * 1e-9

    def between(self, start_ns: int, end_ns: int) -> Signal:
        """The samples with start_ns <= stamp <= end_ns."""
        first, last = np.searchsorted(self.stamps_ns, [start_ns, end_ns + 1])
        return Signal(self.names, self.stamps_ns[first:last], self.values[first:last], self.unit)


NONE = "none"
"""Label of the hypothesis of an unknown movement, which no task may have."""
LONGEST_LABEL = 80
"""Most characters of a label; file systems accept names of 255 bytes, including a number."""
GROUP = "group"
"""Key of a recording's metadata for the person or pair who moved."""
FORBIDDEN = frozenset("/\\\0")
LABEL = f"a label that can name a folder, of 1 to {LONGEST_LABEL} characters, other than {NONE!r}"
"""Condition of `can_name_task` in words."""


def can_name_task(label: object) -> bool:
    """Whether a value can be the label of a task, see `LABEL`."""
    return (
        isinstance(label, str)
        and 1 <= len(label) <= LONGEST_LABEL
        and label.isprintable()
        and label == label.strip()
        and label[0] not in ".-"
        and label != NONE
        and not FORBIDDEN & set(label)
    )

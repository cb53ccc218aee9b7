# SPDX-License-Identifier: Apache-2.0
"""The context while the estimator runs: it may become known late, and change."""

from collections import defaultdict

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.observed import context_misfit
from intent_recognition.signals import CLOCK_RESET_AFTER, LateSamples, Misfit, Observation

CONTEXT_PERIOD_S = 0.2
"""Least time between two changes of context in a movement, each of which filters it anew [s]."""
CONTEXT_SHARE = 0.25
"""Least time between two changes, as a share of the movement so far: bounds the work while an
object is carried. Measured: filtering 100 observations anew takes some 0.1 to 0.2 s."""


class KnownContext:
    """The known part of a library's context; nothing is known at first.

    Attributes:
        learned: the library before it is conditioned on the context.
        values: values of the context, (M,); NaN for unknown numbers.
        misfit: why the last values seem to be in another unit; None if they do not.
    """

    def __init__(self, library: TaskLibrary):
        self.values = np.full(len(library.context_names), np.nan)
        self.use(library)
        self.misfit: Misfit | None = None

    def use(self, library: TaskLibrary) -> None:
        """Switch to another library of the same context; known values stay in use."""
        self.learned = library
        self._used, self._used_at_ns = self.values.copy(), 0
        self._newest_ns: dict[int, int] = {}
        self._late = defaultdict[int, LateSamples](LateSamples)

    def know(self, values: Floats) -> Misfit | None:
        """Set the values (M,), NaN for unknown numbers; return a misfit if the unit seems wrong."""
        model = self.learned.context
        self.misfit = None if model is None else context_misfit(model, values)
        if self.misfit is None:
            self.values = values
        return self.misfit

    def take(self, observation: Observation) -> str | None:
        """Take a sample; return a diagnostics key if it was refused, else None.

        Its `group` is the index of the context signal, in the order of the DOF file.
        """
        model, newest_ns = self.learned.context, self._newest_ns.get(observation.group, 0)
        if model is None or not 0 <= observation.group < len(model.groups):
            return "no_context"
        late, stamp_ns = self._late[observation.group], observation.stamp_ns
        if stamp_ns < newest_ns and late.count(stamp_ns) < CLOCK_RESET_AFTER:
            return "stamp_not_increasing"
        first, size = sum(model.groups[: observation.group]), model.groups[observation.group]
        dofs = range(size) if observation.dofs is None else observation.dofs
        if np.shape(observation.values) != (len(dofs),):
            return "wrong_size"
        if np.any(np.isinf(observation.values)):
            return "not_finite"
        measured = ~np.isnan(observation.values)
        known = self.values.copy()
        known[first + np.array(dofs)[measured]] = observation.values[measured]
        if self.know(known) is not None:
            return "unit"
        self._newest_ns[observation.group] = stamp_ns
        late.forget()
        return None

    def forget_stamps(self) -> None:
        """Forget the stamps, so that earlier samples are accepted; known values stay."""
        self._newest_ns, self._used_at_ns = {}, 0

    def changed(self) -> bool:
        """Whether the known values differ from those in use."""
        model = self.learned.context
        if model is None:
            return False
        same = np.abs(self.values - self._used) <= model.tolerance
        return bool(np.any(~same & ~(np.isnan(self.values) & np.isnan(self._used))))

    def due(self, stamp_ns: int, onset_ns: int) -> bool:
        """Whether to filter the movement since an onset anew, in a changed context."""
        waited_ns = abs(stamp_ns - self._used_at_ns)
        least_ns = max(CONTEXT_PERIOD_S * 1e9, CONTEXT_SHARE * (stamp_ns - onset_ns))
        return waited_ns >= least_ns and self.changed()

    def apply(self, stamp_ns: int = 0) -> TaskLibrary:
        """Take the known values into use from a stamp on; return the library in this context."""
        self._used, self._used_at_ns = self.values.copy(), stamp_ns
        return self.learned.given(self.values)

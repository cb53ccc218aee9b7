# SPDX-License-Identifier: Apache-2.0
"""What is known of the scene while the estimator runs: it may come late, and change."""

from collections import defaultdict

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.observed import context_misfit
from intent_recognition.signals import CLOCK_RESET_AFTER, LateSamples, Misfit, Observation

CONTEXT_PERIOD_S = 0.2
"""Least time between two changes of context in one movement, which is filtered anew at each [s].
Convention: a prediction is not acted on faster."""
CONTEXT_SHARE = 0.25
"""The same as a share of the movement so far, so that the work is bounded where a thing is carried:
filtering 100 observations anew takes some 0.1 to 0.2 s. Measured."""


class KnownContext:
    """The context of a library, if it has one, as far as it is known: not before something comes.

    Attributes:
        learned: that library, whatever is known.
        values: of the context, (M,); NaN for what is not known.
        misfit: why the last values were refused as in another unit, None if it was not.
    """

    def __init__(self, library: TaskLibrary):
        self.values = np.full(len(library.context_names), np.nan)
        self.use(library)
        self.misfit: Misfit | None = None

    def use(self, library: TaskLibrary) -> None:
        """Go on with another library of the same context, in what is known of it (`given`)."""
        self.learned = library
        self._used, self._used_at_ns = self.values.copy(), 0
        self._newest_ns: dict[int, int] = {}
        self._late = defaultdict[int, LateSamples](LateSamples)

    def know(self, values: Floats) -> Misfit | None:
        """Know these (M,), NaN for what is not known, or say why they are in another unit."""
        model = self.learned.context
        self.misfit = None if model is None else context_misfit(model, values)
        if self.misfit is None:
            self.values = values
        return self.misfit

    def take(self, observation: Observation) -> str | None:
        """Take a sample; returns why it was not taken, as a diagnostics key, or None.

        Its `group` counts the context signals, in the order of the DOF file.
        """
        model, newest_ns = self.learned.context, self._newest_ns.get(observation.group, 0)
        if model is None or not 0 <= observation.group < len(model.groups):
            return "no_context"
        late = self._late[observation.group]
        if (
            observation.stamp_ns < newest_ns
            and late.count(observation.stamp_ns) < CLOCK_RESET_AFTER
        ):
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
        self._newest_ns[observation.group] = observation.stamp_ns
        late.forget()
        return None

    def forget_stamps(self) -> None:
        """What comes next may be earlier; what is known of the scene stays."""
        self._newest_ns, self._used_at_ns = {}, 0

    def changed(self) -> bool:
        """Whether more is known than was used, or something else."""
        model = self.learned.context
        if model is None:
            return False
        same = np.abs(self.values - self._used) <= model.tolerance
        return bool(np.any(~same & ~(np.isnan(self.values) & np.isnan(self._used))))

    def due(self, stamp_ns: int, onset_ns: int) -> bool:
        """Whether a movement under way since an onset is to be filtered anew."""
        waited_ns = abs(stamp_ns - self._used_at_ns)
        least_ns = max(CONTEXT_PERIOD_S * 1e9, CONTEXT_SHARE * (stamp_ns - onset_ns))
        return waited_ns >= least_ns and self.changed()

    def apply(self, stamp_ns: int = 0) -> TaskLibrary:
        """Use what is known from a stamp on: the library in this context."""
        self._used, self._used_at_ns = self.values.copy(), stamp_ns
        return self.given(self.learned)

    def given(self, library: TaskLibrary) -> TaskLibrary:
        """A library of the same context in what is known of it."""
        return library if library.context is None else library.given(self.values)

# SPDX-License-Identifier: Apache-2.0
"""The movement under way, and the one that may have begun where the hand last stopped.

Work flows: on the way back from one goal the worker reaches for the next, and never rests. At each
momentary stop a filter starts anew. It takes over once it recognises a task, where the movement
under way was done at the stop, or of no task, and is so now. Where nothing is recognised after a
stop, as in a wave of the hand or a hesitation, the movement under way goes on as if there had been
none.
"""

from collections.abc import Iterable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import MovementFilter, PriorGrid, TaskPosterior
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.motion_detection import MotionDetector
from intent_recognition.signals import Observation

STOP_LEAD = 0.06
"""A reach after a stop began so much earlier than the stop, per usual duration of the tasks: it
first had to halt the hand (docs/decisions/change_of_mind.md)."""
RECOGNISED = 0.9
"""Probability of a task after a stop from which it takes over. Convention: the usual threshold of
the decision."""
DONE_PHASE = 0.85
"""Expected phase of the movement under way from which another may have begun. Convention."""


class Movements:
    """Filters of one movement after the other; a second one while another may have begun.

    Args:
        library: the learned tasks.
        grid: of tasks and durations.
        switching: see `IntentEstimator`.
    """

    def __init__(self, library: TaskLibrary, grid: PriorGrid, *, switching: bool):
        self._make = partial(MovementFilter, library, grid, 0, prune=True, switching=switching)
        self._filter, self._switching = self._make(), switching
        self._after_stop: MovementFilter | None = None  # made at the first stop
        self._stopped = False
        self._lead_ns = round(STOP_LEAD * float(np.exp(np.mean(library.log_duration_mean))) * 1e9)

    def begin(
        self,
        onset_ns: int,
        task_weight: NDArray[np.float64] | None,
        past: Iterable[Observation],
    ) -> MovementFilter:
        """Filter a movement from its onset; the arguments are those of `MovementFilter.restart`."""
        self._filter.restart(onset_ns, task_weight, past)
        self._stopped = False
        return self._filter

    def following(
        self,
        detector: MotionDetector,
        observation: Observation,
        task_weight: NDArray[np.float64] | None,
        posterior: TaskPosterior | None,
    ) -> MovementFilter | None:
        """The filter of a movement that began at the last stop, once it takes over.

        Args:
            detector: notices stops.
            observation: the newest one.
            task_weight: see `MovementFilter`.
            posterior: of the movement so far; None after one that was overdue.
        """
        if not self._switching:
            return None
        stopped_ns, done = detector.stopped_ns(), is_done(posterior)
        if stopped_ns is not None:
            self._stopped = done
        if not self._stopped:
            return None
        after = self._after_stop = self._after_stop or self._make()
        if stopped_ns is not None:
            onset_ns = stopped_ns - self._lead_ns
            after.restart(onset_ns, task_weight, detector.since(onset_ns))
        else:
            after.observe(observation)
        known = after.posterior(observation.stamp_ns).probabilities[:-1]
        if not done or np.max(known) < RECOGNISED:
            return None
        self._filter, self._after_stop = after, self._filter
        self._stopped = detector.waits_for_rest = False
        return after


def is_done(posterior: TaskPosterior | None) -> bool:
    """Whether another movement may have begun: this one is done, or of no task."""
    if posterior is None:
        return True
    best = int(np.argmax(posterior.probabilities))
    return best == len(posterior.probabilities) - 1 or bool(posterior.phase[best] >= DONE_PHASE)

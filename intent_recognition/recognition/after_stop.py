# SPDX-License-Identifier: Apache-2.0
"""The movement that may have begun where the hand last stopped, beside the one under way.

Work flows: on the way back from one goal the worker reaches for the next, and never rests. At each
momentary stop a filter starts anew. It takes over once it recognises a task, where the movement
under way was done at the stop, or of no task, and is so now. Where nothing is recognised after a
stop, as in a wave of the hand or a hesitation, the movement under way goes on as if there had been
none.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.movement import Movement, MovementMemory
from intent_recognition.recognition.posterior import TaskPosterior
from intent_recognition.signals import Observation

STOP_LEAD = 0.06
"""A reach after a stop began so much earlier than the stop, per usual duration of the tasks: it
first had to halt the hand (docs/decisions/change_of_mind.md)."""
RECOGNISED = 0.9
"""Probability of a task after a stop from which it takes over. Convention: the usual threshold of
the decision."""
DONE_PHASE = 0.85
"""Expected phase of the movement under way from which another may have begun. Convention."""


class MovementAfterStop:
    """At most one movement, which began at a stop.

    Args:
        library: the learned tasks.
        make_memory: makes memory for it; called at the first stop.
    """

    def __init__(self, library: TaskLibrary, make_memory: Callable[[], MovementMemory]):
        self._usual_ns = float(np.exp(np.mean(library.log_duration_mean))) * 1e9
        self._make_memory = make_memory
        self._memory: MovementMemory | None = None
        self.forget()

    def forget(self) -> None:
        """There has been no stop."""
        self._movement: Movement | None = None

    def begin(
        self,
        stopped_ns: int,
        since: Callable[[int], list[Observation]],
        task_weight: NDArray[np.float64] | None,
        under_way: TaskPosterior | None,
    ) -> None:
        """Begin with a stop, unless the movement under way is of a task and not done then.

        Args:
            stopped_ns: its stamp.
            since: all observations from a stamp on, in order.
            task_weight: see `MovementFilter`.
            under_way: what is believed of the movement so far; None after one that was overdue.
        """
        self.forget()
        if not is_done(under_way):
            return
        if self._memory is None:
            self._memory = self._make_memory()
        onset_ns = stopped_ns - round(STOP_LEAD * self._usual_ns)
        self._movement = self._memory.begin(onset_ns, since(onset_ns), task_weight)

    def observe(self, observation: Observation) -> None:
        """Take an observation, if there was a stop before it."""
        if self._movement is not None:
            self._movement.observe(observation)

    def takes_over(self, stamp_ns: int, under_way: TaskPosterior | None) -> bool:
        """Whether this is the movement under way from now on.

        Args:
            stamp_ns: now.
            under_way: what is believed of the movement so far; None after one that was overdue.
        """
        if self._movement is None or not is_done(under_way):
            return False
        probabilities = self._movement.posterior(stamp_ns).probabilities
        return bool(np.max(probabilities[:-1]) >= RECOGNISED)

    def hand_over(self, memory: MovementMemory) -> tuple[Movement, MovementMemory]:
        """The movement and its memory, in exchange for that of the one so far."""
        assert self._movement is not None
        assert self._memory is not None
        movement, own, self._memory = self._movement, self._memory, memory
        self.forget()
        return movement, own


def is_done(posterior: TaskPosterior | None) -> bool:
    """Whether another movement may have begun: this one is done, or of no task."""
    if posterior is None:
        return True
    best = int(np.argmax(posterior.probabilities))
    return best == len(posterior.probabilities) - 1 or bool(posterior.phase[best] >= DONE_PHASE)

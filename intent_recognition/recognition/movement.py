# SPDX-License-Identifier: Apache-2.0
"""The movement under way, and the one that may have begun where the hand last stopped.

Work flows: on the way back from one goal the worker reaches for the next, and never rests. At each
momentary stop a filter starts anew. It takes over once it recognises a task, where the movement
under way was done at the stop, or of no task, and is so now. Where nothing is recognised after a
stop, as in a wave of the hand or a hesitation, the movement under way goes on as if there had been
none.
"""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import MovementFilter, PriorGrid
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition.motion_detection import MotionDetector
from intent_recognition.recognition.posterior import (
    TaskBelief,
    TaskPosterior,
    answered,
    task_belief,
)
from intent_recognition.recognition.transitions import Expectation
from intent_recognition.signals import Observation, every_second

MAX_OBSERVATIONS = 2**14
"""Observations of a movement kept for a change of library; beyond, every second one is dropped.

Convention: it bounds the memory.
"""
STOP_LEAD = 0.06
"""A reach after a stop began so much earlier than the stop, per usual duration of the tasks: it
first had to halt the hand (docs/decisions/change_of_mind.md)."""
RECOGNISED = 0.9
"""Probability of a task after a stop from which it takes over. Convention: the usual threshold of
the decision."""
DONE_PHASE = 0.85
"""Expected phase of the movement under way from which another may have begun. Convention."""


class Movement:
    """One movement after the other: what is observed of it, filtered.

    Args:
        movement_filter: used again for each.

    Attributes:
        filter: the same.
        observations: what it has seen.
    """

    def __init__(self, movement_filter: MovementFilter):
        self.filter, self.observations = movement_filter, list[Observation]()
        self._believed: tuple[int, TaskBelief] | None = None

    def begin(
        self, onset_ns: int, past: Iterable[Observation], task_weight: NDArray[np.float64] | None
    ) -> None:
        """Filter a movement from its onset; the one before is no more.

        Args:
            onset_ns: stamp of the onset.
            past: what has been observed of it.
            task_weight: see `MovementFilter`.
        """
        self.filter.restart(onset_ns, task_weight)
        self.observations, self._believed = [], None
        for observation in past:
            self.observe(observation)

    @property
    def onset_ns(self) -> int:
        """Stamp of its onset."""
        return self.filter.onset_ns

    def observe(self, observation: Observation) -> None:
        """Filter an observation."""
        self.filter.observe(observation)
        self.observations.append(observation)
        if len(self.observations) > MAX_OBSERVATIONS:
            self.observations = every_second(self.observations)

    def posterior(self, stamp_ns: int) -> TaskPosterior:
        """What is believed of task and progress at a stamp."""
        run = self.filter
        if self._believed is None or self._believed[0] != run.n_used:
            self._believed = run.n_used, task_belief(run.log_evidence, run.grid, run.born())
        return self._believed[1].at((stamp_ns - self.onset_ns) * 1e-9)


class MovementAfterStop:
    """At most one movement, which began at a stop.

    Args:
        usual_s: how long the tasks usually take.
        make: makes a movement, at the first stop.
    """

    def __init__(self, usual_s: float, make: Callable[[], Movement]):
        self._lead_ns, self._make = round(STOP_LEAD * usual_s * 1e9), make
        self._movement: Movement | None = None
        self._begun = False

    def forget(self) -> None:
        """There has been no stop."""
        self._begun = False

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
        self._begun = is_done(under_way)
        if self._begun:
            self._movement = self._movement or self._make()
            onset_ns = stopped_ns - self._lead_ns
            self._movement.begin(onset_ns, since(onset_ns), task_weight)

    def observe(self, observation: Observation) -> None:
        """Take an observation, if there was a stop before it."""
        if self._movement is not None and self._begun:
            self._movement.observe(observation)

    def take_over(
        self, stamp_ns: int, under_way: TaskPosterior | None, before: Movement
    ) -> Movement | None:
        """The movement under way from now on, if it is this one; in exchange for the one before.

        Args:
            stamp_ns: now.
            under_way: what is believed of the movement so far; None after one that was overdue.
            before: what the next movement after a stop is filtered in.
        """
        found = self._movement
        if found is None or not self._begun or not is_done(under_way):
            return None
        if np.max(found.posterior(stamp_ns).probabilities[:-1]) < RECOGNISED:
            return None
        self._movement, self._begun = before, False
        return found


class Movements:
    """The movement under way, and the one that may have begun where the hand last stopped.

    Args:
        expectation: of the next task; it remembers each movement that ends.
        switching: see `IntentEstimator`.

    Attributes:
        movement: the one under way; None at rest.
        posterior: what is believed of it after the last observation; None at rest.
    """

    _labels: tuple[str, ...]
    _memory: Movement
    _after_stop: MovementAfterStop
    """From `use` on: of the library, what the next movement is filtered in, and what may follow."""

    def __init__(self, expectation: Expectation, *, switching: bool):
        self._expectation, self._switching = expectation, switching
        self.reset()

    def reset(self) -> None:
        """There is no movement under way."""
        self.movement: Movement | None = None
        self.posterior: TaskPosterior | None = None
        self._answer = ""

    @property
    def onset_ns(self) -> int:
        """Stamp of the onset of the movement under way, 0 at rest."""
        return 0 if self.movement is None else self.movement.onset_ns

    @property
    def most_probable(self) -> tuple[MovementFilter | None, int]:
        """The filter of the movement under way, None at rest, and its most probable task."""
        if self.movement is None or self.posterior is None:
            return None, 0
        return self.movement.filter, int(np.argmax(self.posterior.probabilities))

    def use(self, library: TaskLibrary, grid: PriorGrid) -> None:
        """Filter with a library from now on, the movement under way from its onset."""

        def make() -> Movement:
            run = MovementFilter(library, grid, 0, prune=True, switching=self._switching)
            return Movement(run)

        self._labels, self._memory = library.labels, make()
        usual_s = float(np.exp(np.mean(library.log_duration_mean)))
        self._after_stop = MovementAfterStop(usual_s, make)
        if self.movement is not None:
            seen = self.movement.observations
            self.begin(self.movement.onset_ns, seen)
            self.believe(seen[-1].stamp_ns)

    def begin(self, onset_ns: int, past: Iterable[Observation]) -> None:
        """Filter a movement from its onset, in the memory of the one before."""
        self._memory.begin(onset_ns, past, self._expectation.ratio)
        self.movement = self._memory
        self._after_stop.forget()

    def believe(self, stamp_ns: int) -> TaskPosterior | None:
        """Bring what is believed of the movement under way up to a stamp; None at rest."""
        if self.movement is not None:
            self.posterior = self._expectation.weigh(self.movement.posterior(stamp_ns))
            if self._answer in self._labels:
                self.posterior = answered(self.posterior, self._labels.index(self._answer))
        return self.posterior

    def answer(self, task: str) -> None:
        """Count what a person says the movement under way is, until it ends."""
        self._answer = task
        if self.movement is not None:
            self.believe(self.movement.observations[-1].stamp_ns)

    def end(self, stamp_ns: int) -> None:
        """The movement under way is over."""
        if self.posterior is not None:
            self._expectation.remember(stamp_ns, self.posterior)
        self.reset()

    def follow_stops(self, detector: MotionDetector, observation: Observation) -> None:
        """Go over to the movement that began where the hand stopped, once it is recognised."""
        if not self._switching:
            return
        after, stamp_ns = self._after_stop, observation.stamp_ns
        stopped_ns = detector.stopped_ns()
        if stopped_ns is None:
            after.observe(observation)
        else:
            after.begin(stopped_ns, detector.since, self._expectation.ratio, self.posterior)
        taken = after.take_over(stamp_ns, self.posterior, self._memory)
        if taken is not None:
            self.end(stamp_ns)
            detector.waits_for_rest = False
            self.movement = self._memory = taken
            self.believe(stamp_ns)


def is_done(posterior: TaskPosterior | None) -> bool:
    """Whether another movement may have begun: this one is done, or of no task."""
    if posterior is None:
        return True
    best = int(np.argmax(posterior.probabilities))
    return best == len(posterior.probabilities) - 1 or bool(posterior.phase[best] >= DONE_PHASE)

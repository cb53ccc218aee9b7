# SPDX-License-Identifier: Apache-2.0
"""The movement under way, and the memory that one movement after the other is filtered in."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from intent_recognition.filtering import (
    Hypotheses,
    MovementFilter,
    SwitchedHypotheses,
    make_memory,
)
from intent_recognition.promp import ControlGrid, TaskLibrary
from intent_recognition.recognition.posterior import TaskBelief, TaskPosterior, task_belief
from intent_recognition.signals import Observation, every_second

MAX_OBSERVATIONS = 2**14
"""Observations of a movement kept for a change of library; beyond, every second one is dropped.

Convention: it bounds the memory.
"""


class Movement:
    """The movement under way: its filter, and what was observed of it.

    Args:
        movement_filter: one that has seen nothing yet.

    Attributes:
        filter: the same.
        observations: what it has seen.
    """

    def __init__(self, movement_filter: MovementFilter):
        self.filter, self.observations = movement_filter, list[Observation]()
        self._believed: tuple[int, TaskBelief] | None = None

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
            belief = task_belief(run.log_evidence, run.hypotheses, run.switched())
            self._believed = run.n_used, belief
        return self._believed[1].at((stamp_ns - self.onset_ns) * 1e-9)


class MovementMemory:
    """Memory for the filters of one movement after the other.

    Args:
        library: the learned tasks.
        hypotheses: of the onset.
        grids: the `ControlGrid` of tasks that had one; others are added.
        switching: follow a person who turns to another task on the way.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: Hypotheses,
        grids: dict[int, ControlGrid],
        *,
        switching: bool,
    ):
        self._library, self._hypotheses, self._grids = library, hypotheses, grids
        self._bank = make_memory(library, hypotheses)
        scales = hypotheses.n_scales
        self._switched = SwitchedHypotheses(library, scales) if switching else None

    def begin(
        self, onset_ns: int, past: Iterable[Observation], task_weight: NDArray[np.float64] | None
    ) -> Movement:
        """Filter a movement from its onset; the one before in this memory is no more.

        Args:
            onset_ns: stamp of the onset.
            past: what has been observed of it.
            task_weight: see `MovementFilter`.
        """
        movement = Movement(
            MovementFilter(
                self._library,
                self._hypotheses,
                onset_ns,
                memory=self._bank,
                grids=self._grids,
                prune=True,
                task_weight=task_weight,
                switched=self._switched,
            )
        )
        for observation in past:
            movement.observe(observation)
        return movement

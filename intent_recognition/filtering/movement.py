# SPDX-License-Identifier: Apache-2.0
"""A movement under way: the bank that recognises it, and the forecasts beside it."""

from intent_recognition.filtering.bank_run import BankRun
from intent_recognition.filtering.hypotheses import Hypotheses
from intent_recognition.filtering.task_filter import TaskFilters
from intent_recognition.promp import ControlGrid, TaskLibrary
from intent_recognition.signals import Observation


class MovementRun(BankRun):
    """Takes one observation after the other.

    Args:
        library: the learned tasks.
        hypotheses: the grid of tasks and durations.
        onset_ns: stamp from which times count.
        grids: those of `TaskFilters`, kept from movement to movement.
        **options: those of `BankRun`.
    """

    def __init__(
        self,
        library: TaskLibrary,
        hypotheses: Hypotheses,
        onset_ns: int,
        grids: dict[int, ControlGrid] | None = None,
        **options,
    ):
        super().__init__(library, hypotheses, None, onset_ns, **options)
        self.task_filters = TaskFilters(library, hypotheses, onset_ns, grids)

    def observe(self, observation: Observation) -> None:
        """Recognise by an observation, and keep it for the forecasts."""
        super().observe(observation)
        self.task_filters.observe(observation)

# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every hypothesis over task, duration and phase; pruning."""

from intent_recognition.filtering.bank import FilterBank, check_observation, start_bank
from intent_recognition.filtering.bank_run import BankRun, group_dofs, make_memory, run_bank
from intent_recognition.filtering.hypotheses import (
    N_SCALES,
    SCALE_SPAN,
    Hypotheses,
    fixed_hypotheses,
    make_hypotheses,
)
from intent_recognition.filtering.movement import MovementRun
from intent_recognition.filtering.phase_deviation_filter import PhaseDeviationFilter
from intent_recognition.filtering.pruning import PrunedBank, Step
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.filtering.task_filter import TaskFilters

__all__ = [
    "N_SCALES",
    "SCALE_SPAN",
    "BankRun",
    "FilterBank",
    "Hypotheses",
    "MovementRun",
    "PhaseDeviationFilter",
    "PrunedBank",
    "RunningBank",
    "Step",
    "TaskFilters",
    "check_observation",
    "fixed_hypotheses",
    "group_dofs",
    "make_hypotheses",
    "make_memory",
    "run_bank",
    "start_bank",
]

# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every hypothesis over task, duration and phase; pruning."""

from intent_recognition.filtering.bank import FilterBank, condition_bank, start_bank
from intent_recognition.filtering.hypotheses import (
    N_SCALES,
    SCALE_SPAN,
    Hypotheses,
    fixed_hypotheses,
    make_hypotheses,
)
from intent_recognition.filtering.movement import MovementFilter, make_memory, run_bank
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.filtering.phase_deviation_filter import PhaseDeviationFilter
from intent_recognition.filtering.running_bank import RunningBank

__all__ = [
    "N_SCALES",
    "SCALE_SPAN",
    "FilterBank",
    "Hypotheses",
    "MovementFilter",
    "ObservationModel",
    "PhaseDeviationFilter",
    "RunningBank",
    "condition_bank",
    "fixed_hypotheses",
    "make_hypotheses",
    "make_memory",
    "run_bank",
    "start_bank",
]

# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every hypothesis over task, duration and phase; pruning."""

from intent_recognition.filtering.deviation_history import Deviations
from intent_recognition.filtering.filtered_weights import FilterBank
from intent_recognition.filtering.hypotheses import (
    N_SCALES,
    SCALE_SPAN,
    Hypotheses,
    duration_offsets,
    fixed_hypotheses,
    make_hypotheses,
)
from intent_recognition.filtering.movement_filter import MovementFilter, make_memory
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.filtering.running_bank import RunningBank
from intent_recognition.filtering.switching import NEGLIGIBLE, SwitchedBelief, SwitchedHypotheses
from intent_recognition.filtering.task_prediction import TaskPrediction, deviations_at

__all__ = [
    "NEGLIGIBLE",
    "N_SCALES",
    "SCALE_SPAN",
    "Deviations",
    "FilterBank",
    "Hypotheses",
    "MovementFilter",
    "ObservationModel",
    "RunningBank",
    "SwitchedBelief",
    "SwitchedHypotheses",
    "TaskPrediction",
    "deviations_at",
    "duration_offsets",
    "fixed_hypotheses",
    "make_hypotheses",
    "make_memory",
]

# SPDX-License-Identifier: Apache-2.0
"""Recursive conditioning of every hypothesis over task, duration and phase; births; pruning."""

from intent_recognition.filtering.births import NEGLIGIBLE, Births, BornBelief
from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import (
    N_SCALES,
    SCALE_SPAN,
    PriorGrid,
    duration_offsets,
    fixed_prior_grid,
    make_prior_grid,
)
from intent_recognition.filtering.observation_model import ObservationModel
from intent_recognition.filtering.prediction import TaskPrediction, deviations_at
from intent_recognition.filtering.table import Deviations, HypothesisTable

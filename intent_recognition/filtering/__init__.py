# SPDX-License-Identifier: Apache-2.0
"""The filter of a movement: hypotheses over task, duration and phase, their birth and pruning."""

from intent_recognition.filtering.births import NEGLIGIBLE
from intent_recognition.filtering.deviations import Deviations, deviations_at
from intent_recognition.filtering.filter import MovementFilter
from intent_recognition.filtering.grid import (
    N_SCALES,
    PriorGrid,
    duration_offsets,
    fixed_prior_grid,
    make_prior_grid,
)
from intent_recognition.filtering.posterior import TaskPosterior, answered, task_posterior
from intent_recognition.filtering.prediction import TaskPrediction
from intent_recognition.filtering.rates import STOP_LEAD, switch_threshold

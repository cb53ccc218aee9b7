# SPDX-License-Identifier: Apache-2.0
"""Online recognition: the estimator, onset detection, transition prior, and decision to act."""

from intent_recognition.recognition.decision import (
    MAX_SWITCHED,
    MAX_WRONG,
    USUAL_THRESHOLD,
    DecisionSettings,
    DecisionState,
    decide,
    decision_settings,
    is_certain,
    learned_risk,
    least_certain_unit,
    possible_tasks,
    uncertain_end,
)
from intent_recognition.recognition.estimate import Estimate, Prediction
from intent_recognition.recognition.estimator import IntentEstimator
from intent_recognition.recognition.explaining import Evidence, without_dofs
from intent_recognition.recognition.offline import predict_controlled, recognize_task
from intent_recognition.recognition.start_posture import (
    POSTURE_OUTSIDE,
    POSTURE_UNKNOWN,
    start_mean,
)
from intent_recognition.recognition.transitions import FORGET_AFTER_S, TaskMemory

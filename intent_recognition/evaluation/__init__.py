# SPDX-License-Identifier: Apache-2.0
"""Scores of recognition and prediction, calibration, unknown movements, sessions.

Each score and each way of replaying has a file; all use held-out recordings.
"""

from intent_recognition.evaluation.calibration import confusion_counts, reliability_bins
from intent_recognition.evaluation.explaining import Explanation, explain
from intent_recognition.evaluation.folds import Fold, make_folds
from intent_recognition.evaluation.online import run_online, where_both_were_recorded
from intent_recognition.evaluation.protocol import evaluate, remarks_on
from intent_recognition.evaluation.rehearsing import (
    Rehearsal,
    Rehearsed,
    Suggestion,
    rehearsal_to_json,
    rehearse,
    suggest_next,
)
from intent_recognition.evaluation.replaying import replay
from intent_recognition.evaluation.scores import mean_of_task, nearest_neighbour, sample
from intent_recognition.evaluation.scoring import PHASES
from intent_recognition.evaluation.segmenting import (
    propose_segments,
    recognise_segments,
    write_segments,
)
from intent_recognition.evaluation.session_log import (
    ContactLog,
    SessionLog,
    Trace,
    TransferLog,
    usable,
)
from intent_recognition.evaluation.session_summary import (
    CM_PER_M,
    CONDITIONS,
    FIXED_PLACE,
    PAPER_HAND_ERROR,
    PAPER_RECOGNISED,
    DemoSummary,
    HandError,
    InteractionRecord,
    summarise,
    summary_line,
    to_json,
)

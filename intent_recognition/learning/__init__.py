# SPDX-License-Identifier: Apache-2.0
"""From demonstrations to a task library: examples, statistics, hyperparameters, unknown tasks.

Each file learns one part of the library or makes one choice by validation.
"""

from intent_recognition.learning.accumulation import (
    BATCH,
    NAMES_KEPT,
    REFERENCE_RECORDINGS,
    Accumulated,
    accumulate,
    merge_accumulated,
)
from intent_recognition.learning.components import (
    MAX_COMPONENTS,
    choose_components,
    predict_left_out,
    purity,
    score,
    smallest_within_one_error,
)
from intent_recognition.learning.correcting import (
    RuleChange,
    change_rule,
    inferred_weights,
    keep_correction,
    move_task,
)
from intent_recognition.learning.examples import (
    TrainingExample,
    cut_one,
    cut_to_movement,
    make_example,
    pose_phases,
    sample_phases,
)
from intent_recognition.learning.fitting import library_from_statistics
from intent_recognition.learning.hyperparameters import Hyperparameters
from intent_recognition.learning.interaction_promp import fit_interaction_promp
from intent_recognition.learning.mixture import (
    BASIS,
    MIN_MEMBERS,
    RIDGE,
    SAMPLED_PHASES,
    Clustering,
    Features,
    cluster,
    mixture_features,
)
from intent_recognition.learning.preprocessing import (
    Preprocessing,
    SignalNames,
    angle_references,
    example_of,
    examples_together,
    in_turns,
    slips_of,
)
from intent_recognition.learning.selection import FRACTIONS
from intent_recognition.learning.settings import SEGMENTATIONS, TrainingSettings
from intent_recognition.learning.statistics import TaskStatistics, summarize
from intent_recognition.learning.timing import PACES, Timing
from intent_recognition.learning.training import (
    Trained,
    TrainingReport,
    add_demonstration,
    add_statistics,
    choose_again,
    learn,
    learn_accumulated,
    learn_with_report,
    with_margins,
)
from intent_recognition.learning.transitions import count_transitions, smoothed_transitions
from intent_recognition.learning.unknown_task import is_outdated
from intent_recognition.learning.unlabelled import (
    Relabelled,
    label_by_components,
    learn_components,
    learn_mixture,
)

# SPDX-License-Identifier: Apache-2.0
"""Improvement of a primitive by practice: what to practise, where to search, what it costs."""

from intent_recognition.improvement.cost import Cost, Rollout, load_cost
from intent_recognition.improvement.search import (
    CovarianceSearch,
    Search,
    SearchSpace,
    next_point,
    search_space,
    settled_point,
)
from intent_recognition.improvement.session import (
    STATE,
    Practice,
    PracticeSession,
    compare,
    mean_cost,
)
from intent_recognition.improvement.task_practice import (
    N_PHASES,
    TaskPractice,
    arrival_s,
    check_task,
)

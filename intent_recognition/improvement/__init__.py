# SPDX-License-Identifier: Apache-2.0
"""Improving a primitive by practice: what is practised, where to look, and what it costs."""

from intent_recognition.improvement.cost import COSTS, Cost, CostOf, Rollout, load_cost
from intent_recognition.improvement.practice import Practice, PracticeComparison, attempt, compare
from intent_recognition.improvement.search import (
    CovarianceSearch,
    Search,
    next_point,
    settled_point,
)
from intent_recognition.improvement.session import STATE, PracticeSession, Tried
from intent_recognition.improvement.space import BOUND, SearchSpace, search_space
from intent_recognition.improvement.task_practice import TaskPractice, arrival_s

__all__ = [
    "BOUND",
    "COSTS",
    "STATE",
    "Cost",
    "CostOf",
    "CovarianceSearch",
    "Practice",
    "PracticeComparison",
    "PracticeSession",
    "Rollout",
    "Search",
    "SearchSpace",
    "TaskPractice",
    "Tried",
    "arrival_s",
    "attempt",
    "compare",
    "load_cost",
    "next_point",
    "search_space",
    "settled_point",
]

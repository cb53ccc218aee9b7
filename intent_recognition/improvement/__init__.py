# SPDX-License-Identifier: Apache-2.0
"""Improving a primitive by practice: where in its weights to look, and where to look next."""

from intent_recognition.improvement.search import (
    CovarianceSearch,
    Search,
    next_point,
    settled_point,
)
from intent_recognition.improvement.space import BOUND, SearchSpace, search_space

__all__ = [
    "BOUND",
    "CovarianceSearch",
    "Search",
    "SearchSpace",
    "next_point",
    "search_space",
    "settled_point",
]

# SPDX-License-Identifier: Apache-2.0
"""Practice: rollouts of a primitive, what each cost, and a folder that keeps them."""

from sim_bridge.practice.cost import COSTS, Cost, CostOf, Rollout, load_cost
from sim_bridge.practice.session import Practice, PracticeSession, Tried

__all__ = [
    "COSTS",
    "Cost",
    "CostOf",
    "Practice",
    "PracticeSession",
    "Rollout",
    "Tried",
    "load_cost",
]

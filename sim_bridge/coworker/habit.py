# SPDX-License-Identifier: Apache-2.0
"""The coworker's habit: which task follows which when one toolbox after the other is assembled.

Per box a plate, a screw, the screwdriver; now and then a part is skipped or taken twice. A
first-order Markov chain, drawn from a seed. Nothing of it is told to the robot, which learns it
from recordings of earlier sessions.
"""

import numpy as np

from sim_bridge.coworker.styles import HOLD, PLATE, SCREW

ORDER = (PLATE, SCREW, HOLD)
"""The tasks of one box, in their usual order."""
FIRST = np.array([0.8, 0.1, 0.1])
"""Probability of the first task, in ORDER."""
FOLLOWS = np.array([[0.05, 0.85, 0.10], [0.05, 0.10, 0.85], [0.85, 0.10, 0.05]])
"""Probability of the next task (columns) after each (rows), both in ORDER."""


def habitual_tasks(seed: int, count: int) -> tuple[str, ...]:
    """The tasks of a session in the order of the habit, the same for the same seed."""
    rng = np.random.default_rng([seed, 11])
    tasks: list[str] = []
    row = FIRST
    for _ in range(count):
        k = int(rng.choice(len(ORDER), p=row))
        tasks.append(ORDER[k])
        row = FOLLOWS[k]
    return tuple(tasks)

# SPDX-License-Identifier: Apache-2.0
"""How probable a left-out demonstration ever makes other tasks than its own.

From these odds follows from which probability a task may be acted on (`promp.risk_of`,
docs/recognition.md). Demonstrations of a person are left out together, so that the odds are those
of somebody new; where nobody else was recorded, one demonstration after the other.
"""

from collections.abc import Mapping

import numpy as np

from intent_recognition.learning.examples import TrainingExample
from intent_recognition.learning.held_out import paired_examples
from intent_recognition.learning.left_out import LeavingOut
from intent_recognition.learning.statistics import TaskStatistics
from intent_recognition.learning.switch_margin import follow
from intent_recognition.promp import NO_ODDS, LeftOutOdds, TaskLibrary

MAX_FOLLOWED = 40
"""Demonstrations that are followed at most. Convention: it bounds the time; 19 suffice for a share
of one in twenty."""


def learn_left_out_odds(
    library: TaskLibrary,
    tasks: Mapping[str, TaskStatistics],
    recorded: Mapping[str, TaskStatistics],
) -> LeftOutOdds:
    """The largest odds against its own task along each demonstration that was left out.

    Args:
        library: the learned tasks, with all margins.
        tasks: statistics that it was built from.
        recorded: statistics of the examples as they were recorded.
    """
    if library.n_tasks == 1:
        return NO_ODDS
    leaving_out = LeavingOut(library, tasks)
    odds, groups = list[float](), list[str]()
    for k, example, as_recorded in paired_examples(tasks, recorded, MAX_FOLLOWED):
        without = leaving_out.unseen(k, example)
        if without is not None:
            odds.append(largest_odds_against(without.as_library(), k, as_recorded))
            groups.append(example.group if leaving_out.group(example.group) else "")
    return LeftOutOdds(tuple(odds), tuple(groups)) if len(odds) > 1 else NO_ODDS


def largest_odds_against(library: TaskLibrary, task: int, recorded: TrainingExample) -> float:
    """Highest log odds of the other tasks against the true one along a movement.

    Args:
        library: one that does not know the movement.
        task: number of the true one.
        recorded: the movement.
    """
    followed = follow(library, recorded)
    beliefs = [run.births.belief(run.log_evidence) for run in followed if run.births]
    total = np.array([one.log_joint[:-1] for one in beliefs])
    others = np.logaddexp.reduce(np.delete(total, task, axis=1), axis=1)
    return float(np.max(others - total[:, task]))

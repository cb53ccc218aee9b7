# SPDX-License-Identifier: Apache-2.0
"""Sessions in which one movement flows into the next: is each task recognised, in order?"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from experiments.toolbox.session import SeenEstimate, watch
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator
from sim_bridge.coworker import WITHOUT_PAUSE, Interaction, parse_task_list, plan_session
from sim_bridge.scenarios.toolbox import DECIDED_WITHIN_S, EARLIEST_DECISION_S

BEGINNINGS = ("activated", "switched")
"""Events of a decision that make another task active."""
SESSION_SEED = 5000
"""Added to the seed, so that no session repeats another experiment's."""


class FlowingSession(NamedTuple):
    """What became of a session without pauses.

    Attributes:
        tasks: what the coworker did, in order.
        recognised: whether each task was the last to become active between
            `EARLIEST_DECISION_S` before its onset and `DECIDED_WITHIN_S` after its end, (n,).
        activated: every task that became active, in order.
    """

    tasks: tuple[str, ...]
    recognised: tuple[bool, ...]
    activated: tuple[str, ...]

    @property
    def in_order(self) -> bool:
        """Whether what became active is what was done, and nothing else."""
        return self.activated == self.tasks


def follow_sessions(
    library: TaskLibrary,
    seed: int,
    count: int,
    interactions: int,
    progress: Callable[[float, str], None] = lambda share, what: None,
) -> list[FlowingSession]:
    """Let an estimator see whole sessions from a first seed on, and never reset it within one."""
    sessions = []
    for k in range(count):
        progress(k / count, f"session {k + 1} without pauses")
        own = SESSION_SEED + seed + k
        plan = plan_session(own, parse_task_list("random", own, interactions), WITHOUT_PAUSE)
        sessions.append(
            score_flowing(plan.interactions, list(watch(IntentEstimator(library), plan.samples)))
        )
    return sessions


def score_flowing(
    interactions: Sequence[Interaction], seen: Sequence[SeenEstimate]
) -> FlowingSession:
    """Score the decisions of a session against its interactions."""
    begun = [one for one in seen if one.decision.event in BEGINNINGS]
    at_s = np.array([one.time_s for one in begun])
    recognised = []
    for interaction in interactions:
        window = [interaction.onset_s - EARLIEST_DECISION_S, interaction.end_s + DECIDED_WITHIN_S]
        first, last = np.searchsorted(at_s, window)
        found = [one.decision.active for one in begun[first:last]]
        recognised.append(bool(found) and found[-1] == interaction.task)
    return FlowingSession(
        tuple(interaction.task for interaction in interactions),
        tuple(recognised),
        tuple(one.decision.active for one in begun),
    )

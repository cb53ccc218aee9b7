# SPDX-License-Identifier: Apache-2.0
"""What is played goes on only as fast as the nodes under test take it, however busy the machine."""

import time
from collections.abc import Callable

from intent_recognition.nodes.bag_player import BagPlayer
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.mocap_ingest import MocapIngest

LONGEST_STEP_S = 0.02


def n_taken(ingest: MocapIngest, estimator: IntentEstimatorNode) -> int:
    """Poses that have reached the estimator, and what the ingest refused."""
    totals = dict(estimator._diagnostics._totals)
    arrived = sum(n for stream, n in totals.items() if stream.startswith("human/"))
    return arrived + ingest._diagnostics._counts.total()


class PacedPlayer(BagPlayer):
    """Plays an observation when the one before has been taken: none is lost on the way.

    Args:
        topics: of the observations, as in the DOF file.
        ingest: takes them first.
        estimator: takes them in the end.
        kwargs: of the player.
    """

    def __init__(
        self, topics: set[str], ingest: MocapIngest, estimator: IntentEstimatorNode, **kwargs
    ):
        self._observed, self._chain, self._n_sent = topics, (ingest, estimator), 0
        super().__init__(**kwargs)

    def _publish(self, message, *when):
        super()._publish(message, *when)
        if message.topic.lstrip("/") not in self._observed:
            return
        self._n_sent += 1
        while n_taken(*self._chain) < self._n_sent:
            if self._stopping.wait(0.001):
                return


class PatientClock:
    """Real time [s], less what passes while someone is behind, and while nobody asks."""

    def __init__(self, behind: Callable[[], bool]):
        self._behind = behind
        self._now_s = self._asked_s = time.monotonic()

    def __call__(self) -> float:
        asked_s = time.monotonic()
        if not self._behind():
            self._now_s += min(asked_s - self._asked_s, LONGEST_STEP_S)
        self._asked_s = asked_s
        return self._now_s

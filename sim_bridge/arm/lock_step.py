# SPDX-License-Identifier: Apache-2.0
"""Simulated time that waits for nodes to answer, so that results do not depend on a busy machine.

Nodes report how many messages of each topic they have received and sent. Time goes on when all
messages sent between the clock and the arm have been received, without sleeping or guessing.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple


class Edge(NamedTuple):
    """A topic from one node to another."""

    topic: str
    sender: str
    taker: str


ARM = ""
"""Name of the arm itself in edges."""
EDGES = (
    Edge("/clock", ARM, "coworker_sim"),
    Edge("joint_states", ARM, "primitive_activation"),
    Edge("mocap/wrist/pose", "coworker_sim", "mocap_ingest"),
    Edge("human/wrist", "mocap_ingest", "intent_estimator"),
    Edge("intent/tasks", "intent_estimator", "primitive_activation"),
    Edge("intent/robot_trajectory", "intent_estimator", "primitive_activation"),
    Edge("intent/human_trajectory", "intent_estimator", "primitive_activation"),
    Edge("joint_trajectory", "primitive_activation", ARM),
    Edge("intent/active_task", "primitive_activation", ARM),
    Edge("mocap/wrist/pose", "coworker_sim", ARM),
    Edge("joint_states", ARM, "object_transfer"),
    Edge("intent/holding", ARM, "object_transfer"),
    Edge("human/wrist", "mocap_ingest", "object_transfer"),
    Edge("intent/active_task", "primitive_activation", "object_transfer"),
    Edge("joint_trajectory", "primitive_activation", "object_transfer"),
    Edge("intent/transfer", "object_transfer", "primitive_activation"),
    Edge("intent/transfer", "object_transfer", ARM),
    Edge("mocap/wrist/pose", "coworker_sim", "session_observer"),
    Edge("intent/tasks", "intent_estimator", "session_observer"),
    Edge("joint_states", ARM, "session_observer"),
    Edge("joint_states", ARM, "warped_primitive"),
    Edge("intent/transfer", "object_transfer", "session_observer"),
    Edge("coworker/hand", ARM, "session_observer"),
    Edge("intent/active_task", "primitive_activation", "session_observer"),
)
"""Edges from the clock to the person, the estimate, the command and the arm, and to observers."""
AT_WILL = "intent/human_trajectory"
"""Topic whose taker may not subscribe; one that does lists it among its counts."""
ALWAYS = ("joint_trajectory",)
"""Topics that the arm receives in every scene."""
ANSWERING = tuple(dict.fromkeys(edge.taker for edge in EDGES if edge.taker))
"""Nodes that answer."""
PERSON = "coworker_sim"
"""Node with whose first answer time begins: it answers when it and all it waits for are ready."""
NO_ANSWER_S = 10.0
"""Time without an answer after which a node is reported, and simulated time goes on [s]."""


class LockStep:
    """Tracks whether nodes have received what was sent; the arm itself receives `takes`.

    Time begins with the first answer of `PERSON`, if that is one of the nodes. Others are not
    waited for before their first answer: messages missed until then do not count.

    Attributes:
        begun: whether time has begun.
    """

    def __init__(self, nodes: Sequence[str], takes: Collection[str] = ALWAYS) -> None:
        known = {ARM, *nodes}
        self.begun = PERSON not in nodes
        self._edges = [
            edge
            for edge in EDGES
            if {edge.sender, edge.taker} <= known and (edge.taker != ARM or edge.topic in takes)
        ]
        self._counts: dict[str, dict[str, int]] = {ARM: {}}
        self._lost: dict[Edge, int] = {}

    def hear(self, node: str, counts: Mapping[str, int]) -> None:
        """Take a node's counts of messages received and sent per topic since its start.

        Empty counts leave out a node that need not be waited for. Counts of several people's topics
        are added up.
        """
        self.begun |= node == PERSON
        before, counts = self._counts.get(node, {}), _of_all_people(counts)
        if any(counts.get(topic, 0) < n for topic, n in before.items()):  # it has started again
            self.leave(node)
        if counts:
            self._counts[node] = counts

    def note(self, topic: str) -> None:
        """Count a message that the arm has sent or received on a topic."""
        own = self._counts[ARM]
        own[topic] = own.get(topic, 0) + 1

    def missing(self) -> Edge | None:
        """First edge on which a sent message has not been received; None if nothing is missing.

        Edges are checked in order, only up to the first with a missing message. Up to there each
        sender has reported all it sent, since it reports that together with what it received.
        Beyond, a receiver's answer may precede its sender's, and losses would be underestimated.
        """
        return next((edge for edge in self._edges if self._due(edge)), None)

    def _due(self, edge: Edge) -> bool:
        """Whether a message is missing on an edge whose ends have both answered."""
        sender, taker = self._counts.get(edge.sender), self._counts.get(edge.taker)
        if sender is None or taker is None or (edge.topic == AT_WILL and AT_WILL not in taker):
            return False
        due = max(sender.get(edge.topic, 0) - taker.get(edge.topic, 0), 0)
        lost = self._lost[edge] = min(self._lost.get(edge, due), due)
        return due > lost

    def leave(self, node: str) -> None:
        """Stop waiting for a node until it answers again."""
        self._counts.pop(node, None)
        self._lost = {e: n for e, n in self._lost.items() if node not in (e.sender, e.taker)}


def _of_all_people(counts: Mapping[str, int]) -> dict[str, int]:
    """Counts by the topics of edges, summed over the topics of several people."""
    total: Counter[str] = Counter()
    for topic, n in counts.items():
        first, _, rest = topic.partition("/")
        short = f"{first}/{rest.partition('/')[2]}"
        total[short if short in _TOPICS else topic] += n
    return dict(total)


_TOPICS = {edge.topic for edge in EDGES}

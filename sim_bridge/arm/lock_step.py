# SPDX-License-Identifier: Apache-2.0
"""Simulated time that waits for the nodes that must answer, so that a busy machine changes nothing.

Nodes say how many messages of each topic they have taken and sent. Time goes on when all that was
sent along the way from the clock to the arm has been taken: nobody sleeps, and nobody is guessed.
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
"""From the clock to the person, the estimate, the command and back to the arm; and to who looks."""
ALWAYS = ("joint_trajectory",)
"""Topics that the arm takes in every scene."""
ANSWERING = tuple(dict.fromkeys(edge.taker for edge in EDGES if edge.taker))
"""Nodes that answer."""
NO_ANSWER_S = 10.0
"""Time without an answer after which a node is named, and time goes on [s]. Convention."""


class LockStep:
    """Whether the nodes have taken what was sent; the arm itself takes the topics `takes`.

    Nodes that have not answered yet are not waited for: what one missed before does not count.
    """

    def __init__(self, nodes: Sequence[str], takes: Collection[str] = ALWAYS) -> None:
        known = {ARM, *nodes}
        self._edges = [
            edge
            for edge in EDGES
            if {edge.sender, edge.taker} <= known and (edge.taker != ARM or edge.topic in takes)
        ]
        self._counts: dict[str, dict[str, int]] = {ARM: {}}
        self._lost: dict[Edge, int] = {}

    def hear(self, node: str, counts: Mapping[str, int]) -> dict[str, int]:
        """Take how many messages of each topic a node has taken and sent since its start.

        None of any: it is not to be waited for. What several people have of a topic is added up;
        returns the sums.
        """
        before, counts = self._counts.get(node, {}), _of_all_people(counts)
        if any(counts.get(topic, 0) < n for topic, n in before.items()):  # it has started again
            self.leave(node)
        if counts:
            self._counts[node] = counts
        return counts

    def note(self, topic: str) -> None:
        """The arm has sent or taken a message of a topic."""
        own = self._counts[ARM]
        own[topic] = own.get(topic, 0) + 1

    def missing(self) -> Edge | None:
        """Where not all that was sent has been taken; None if nothing is missing.

        Edges are looked at along the way, up to the first where something is missing: a sender has
        told of what it sent as soon as it has told of what it took. Further on, a taker's answer
        may be there before its sender's, and what was lost would be taken for less than it is.
        """
        return next((edge for edge in self._edges if self._due(edge)), None)

    def _due(self, edge: Edge) -> bool:
        """Whether something is missing on an edge, both ends of which have answered."""
        sender, taker = self._counts.get(edge.sender), self._counts.get(edge.taker)
        if sender is None or taker is None:
            return False
        due = max(sender.get(edge.topic, 0) - taker.get(edge.topic, 0), 0)
        lost = self._lost[edge] = min(self._lost.get(edge, due), due)
        return due > lost

    def leave(self, node: str) -> None:
        """Wait for a node no longer, until it answers again."""
        self._counts.pop(node, None)
        self._lost = {e: n for e, n in self._lost.items() if node not in (e.sender, e.taker)}


def _of_all_people(counts: Mapping[str, int]) -> dict[str, int]:
    """Counts by the topics of edges: what several people have of one is added up."""
    total: Counter[str] = Counter()
    for topic, n in counts.items():
        first, _, rest = topic.partition("/")
        short = f"{first}/{rest.partition('/')[2]}"
        total[short if short in _TOPICS else topic] += n
    return dict(total)


_TOPICS = {edge.topic for edge in EDGES}

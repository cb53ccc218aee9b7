# SPDX-License-Identifier: Apache-2.0
"""A simulated clock that waits for nodes to answer, and goes on without those that do not."""

import time
from collections.abc import Collection, Sequence

from rclpy.node import Node
from sensor_msgs.msg import JointState

from intent_recognition.nodes.diagnostics import UNANSWERED, Diagnostics
from intent_recognition.registry import ANSWERS
from sim_bridge.arm import NO_ANSWER_S, Edge, LockStep

LEFT_S = 0.2
"""Time without an answer after which it is checked whether a node has left the graph [s]."""


class ClockAnswers:
    """Answers of the nodes for which the clock waits; see `LockStep`.

    `answering` holds the names of these nodes; if it is empty, time never waits. The clock's own
    node receives the topics `takes`.
    """

    def __init__(
        self, node: Node, answering: Sequence[str], diagnostics: Diagnostics, takes: Collection[str]
    ) -> None:
        self._node, self._answering, self._diagnostics = node, answering, diagnostics
        self._lock_step = LockStep(answering, takes)
        self._since_s: float | None = None
        self._unanswered: list[str] = []

    def note(self, topic: str) -> None:
        """Count a message of the clock's own node."""
        self._lock_step.note(topic)

    @property
    def begun(self) -> bool:
        """Whether time has begun."""
        return self._lock_step.begun

    def hear(self, message: JointState) -> None:
        """Take an answer of a node for which the clock waits; ignore others."""
        node = message.header.frame_id
        if node not in self._answering:
            return
        try:
            counts = dict(zip(message.name, map(int, message.position), strict=True))
        except (ValueError, OverflowError):
            text = f"{ANSWERS} of {node}: expected one whole number per topic"
            self._diagnostics.reject("bad_answer", text)
            return
        self._lock_step.hear(node, counts)

    def all_came(self) -> bool:
        """Whether time has been stopped and all missing answers have come."""
        return self._since_s is not None and not self._lock_step.missing()

    def wait(self) -> bool:
        """Whether time must wait for a node's answer; a node that never answers is reported."""
        missing = self._lock_step.missing() if self._answering else None
        if missing is None:
            self._since_s = None
            return False
        now_s = time.monotonic()
        since_s = self._since_s = self._since_s or now_s
        gone = self._gone(missing) if now_s - since_s >= LEFT_S else ""
        late = missing.taker or missing.sender
        if not gone and now_s - since_s < NO_ANSWER_S:
            return True
        if not gone:
            text = f"{late} has not answered for {NO_ANSWER_S:g} s, of {missing.topic}"
            self._diagnostics.reject("no_answer", text)
            self._unanswered.append(late)
            self._diagnostics.value(UNANSWERED, ", ".join(self._unanswered))
        self._lock_step.leave(gone or late)
        self._since_s = None
        return False

    def _gone(self, edge: Edge) -> str:
        here = self._node.get_namespace()
        found = self._node.get_node_names_and_namespaces()
        present = {"", *(name for name, space in found if space == here)}
        return next((name for name in (edge.sender, edge.taker) if name not in present), "")

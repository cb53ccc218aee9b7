# SPDX-License-Identifier: Apache-2.0
"""Whether the nodes of a graph are ready for what comes: by what they say of themselves."""

from collections.abc import Iterable, Mapping

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from intent_recognition.nodes.diagnostics import INACTIVE, LIFECYCLE, PUBLISHERS, values_of


class Readiness:
    """Listens to `/diagnostics` for nodes that must be there before something begins.

    A node is ready when it has reported, is active if it has a lifecycle, and has matched the
    publishers of every topic it watches that has any in the graph.
    """

    def __init__(self, node: Node, names: Iterable[str]):
        self._node = node
        self._space = node.get_namespace().rstrip("/") + "/"
        self._names = [name for name in names if name]
        self._reports: dict[str, Mapping[str, str]] = {}
        if self._names:
            node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)

    def missing(self) -> list[str]:
        """Names of the nodes that are not ready yet."""
        return [name for name in self._names if not self._is_ready(name)]

    def forget(self, name: str) -> None:
        """Wait for a node anew: it has ended."""
        self._reports.pop(f"{self._space}{name}".lstrip("/"), None)

    def _is_ready(self, name: str) -> bool:
        report = self._reports.get(f"{self._space}{name}".lstrip("/"))
        if report is None or report.get(LIFECYCLE) == INACTIVE:
            return False
        return all(
            value != "0" or not self._node.count_publishers(key.removeprefix(PUBLISHERS))
            for key, value in report.items()
            if key.startswith(PUBLISHERS)
        )

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._reports[status.name] = values_of(status)

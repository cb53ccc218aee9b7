# SPDX-License-Identifier: Apache-2.0
"""Via points of the estimator node: a parameter in, the points in force out."""

from collections.abc import Sequence

from rclpy.node import Node
from std_msgs.msg import String

from intent_recognition.composing import (
    BentLibrary,
    ViaPoint,
    check_via_points,
    hand_columns,
    read_via_points,
    write_via_points,
)
from intent_recognition.errors import IntentError
from intent_recognition.kinematics import Arm
from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import declare
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import IntentEstimator

VIA_POINTS = "via_points"


class ViaPointInput:
    """Takes the parameter `via_points`, and publishes the points in force on `intent/via_points`.

    If joints are predicted, points of the hand wait for `robot_description`. Points that prove
    unusable when they are put in force are counted under `bad_via_points`.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._diagnostics = diagnostics
        self._publisher = node.create_publisher(String, "intent/via_points", qos.LATCHED)
        self._points = read_via_points(declare(node, "via_points")[VIA_POINTS])
        self._estimators: Sequence[IntentEstimator] = ()
        self._bent = BentLibrary()
        self._refused: tuple[tuple[ViaPoint, ...], TaskLibrary | None] = (), None
        self._shown: tuple[tuple[ViaPoint, ...], tuple[str, ...]] | None = None

    def check(self, text: str, estimators: Sequence[IntentEstimator], arm: Arm | None) -> None:
        """Refuse a value of the parameter that cannot be used."""
        points = read_via_points(text)
        if estimators:
            check_via_points(estimators[0].taught, points, arm)

    def change(self, text: str) -> None:
        """Set a value that was checked; `use` puts it in force."""
        self._points = read_via_points(text)

    def use(self, estimators: Sequence[IntentEstimator], arm: Arm | None) -> None:
        """Put new points in force for all people, and publish which are in force."""
        if not estimators:
            return
        library = estimators[0].taught
        if self._estimators != estimators:  # a new estimator has no points in force
            self._estimators, self._bent = estimators, BentLibrary()
        refused = self._refused[0] == self._points and self._refused[1] is library
        if self._points != self._bent.points and not refused:
            waits = arm is None and not hand_columns(library.controlled_names)
            if waits and any(point.of_hand for point in self._points):
                return
            try:
                check_via_points(library, self._points, arm)
            except IntentError as error:
                self._refused = self._points, library
                self._diagnostics.reject("bad_via_points", str(error))
            else:
                self._bent = BentLibrary(self._points, arm)
                for estimator in estimators:
                    estimator.bend(self._bent.through)
        self._show()

    def _show(self) -> None:
        shown = self._bent.points, self._bent.not_passed
        if shown == self._shown:
            return
        self._shown, (asked, left_out) = shown, shown
        points = [point for point in asked if point.name not in left_out]
        self._publisher.publish(String(data=write_via_points(points)))
        self._diagnostics.value("via points", ", ".join(p.name for p in points) or "none")
        self._diagnostics.value("via points left out", ", ".join(left_out) or "none")

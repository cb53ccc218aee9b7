# SPDX-License-Identifier: Apache-2.0
"""What plans keep clear of: boxes, things of a planning scene, and the arm itself."""

import time

from rclpy.node import Node

from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.kinematics import Bodies, Box, parse_boxes
from intent_recognition.motion import Clearance, Spread
from intent_recognition.nodes.activation_parameters import Taught
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.planning_scene import BOTH, READ, PlanningSceneLink
from intent_recognition.nodes.prediction_input import RejectionError


class ClearanceInput:
    """Makes the clearance for each description of the arm.

    Attributes:
        clearance: None where nothing is kept clear of, or as long as the arm is not known.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics) -> None:
        self._node, self._diagnostics = node, diagnostics
        values = declare(node, "clearance")
        self._distance_m = values["clearance"]
        self._boxes = parse_boxes(values["boxes"])
        self._largest_bend = values["largest_bend"]
        self._times_s = values["replan_budget"], values["clear_wait"]
        if self._boxes and not self._distance_m:
            cure = "Try 0.02, or leave boxes empty."
            raise ArgumentError.about("clearance", "above 0 m with boxes", 0.0, cure)
        use = values["planning_scene"]
        if use in (READ, BOTH) and not self._distance_m:
            cure = "Try 0.02, or leave planning_scene off."
            raise ArgumentError.about("clearance", "above 0 m with a planning scene", 0.0, cure)
        self._scene = PlanningSceneLink(
            node, diagnostics, use, values["planning_frame"], self._boxes
        )
        self._of_scene: tuple[Box, ...] = ()
        self.clearance: Clearance | None = None
        self._description = ""
        self._taught: Taught | None = None
        self._rejection: RejectionError | None = None

    def update(self, description: str, names: tuple[str, ...], taught: Taught) -> bool:
        """Whether there is another clearance than before.

        Args:
            description: URDF of the arm; empty where it is not known.
            names: of its joints.
            taught: tasks whose motions may be bent.

        Raises:
            RejectionError: things are to be kept clear of, and there is no description for it.
        """
        if not self._distance_m:
            return False
        if not description:
            raise RejectionError("no_robot_description", "clearance is set, but for which arm?")
        changed = (description, self._scene.boxes) != (self._description, self._of_scene)
        changed |= taught is not self._taught
        if changed:
            self._description, self._taught, self._rejection = description, taught, None
            self._of_scene = self._scene.boxes
            try:
                self._make(description, names, taught)
            except IntentError as error:
                self._rejection = RejectionError("bad_robot_description", str(error))
        if self._rejection is not None:
            raise self._rejection
        return changed

    def _make(self, description: str, names: tuple[str, ...], taught: Taught) -> None:
        boxes = (*self._boxes, *self._of_scene)
        bodies = Bodies(description, names, boxes, clearance_m=self._distance_m)
        spreads = taught.spreads(Spread.of)
        self.clearance = Clearance(
            bodies, spreads, self._largest_bend, *self._times_s, self._spent_s
        )
        things = ", ".join([*(box.name for box in boxes), "itself"])
        self._node.get_logger().info(
            f"keeps {self._distance_m:g} m clear of {things}: {len(bodies.pairs)} pairs of bodies"
        )

    def _spent_s(self) -> float:
        """Processor time; none passes where time waits for the node: a busy machine plans alike."""
        return 0.0 if self._diagnostics.answers else time.thread_time()

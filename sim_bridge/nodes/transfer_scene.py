# SPDX-License-Identifier: Apache-2.0
"""The scene "transfers" of a simulated arm: objects that are handed over by force, and its topics.

In: `intent/transfer`, which the fingers follow, and `mocap/wrist/pose`, the worker's hand; with
`persons`, each person's wrist, and `intent/active_person`, the person who takes and gives.
Out: `intent/holding`, whether the fingers took an object from a stand, and `coworker/hand`, the
ground truth.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String

from intent_recognition.errors import MessageError, one_line
from intent_recognition.nodes.conversions import joint_values, position_array
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.people import named_people
from intent_recognition.nodes.qos import LATCHED, SENSOR, STATE
from intent_recognition.transfer import Holding
from sim_bridge.arm import SimulatedArm
from sim_bridge.scenarios.toolbox import ToolboxTransfers

TRANSFERS = "transfers"
"""Name of the scene."""
TAKES = ("intent/transfer", "mocap/wrist/pose")
"""Topics that the arm must receive before the clock goes on."""
HAND, HOLDING = "coworker/hand", "intent/holding"
AXES = ("force_x", "force_y", "force_z")
"""Names of the components of the person's force on the object [N], world."""
UPDATE_EVERY = 5
"""Physics steps between two updates of the hands (5 ms)."""


class TransferScene:
    """Translates between topics and `ToolboxTransfers`.

    `arm`, `seed` and `lever_m` are those of `ToolboxTransfers`. `stamp` returns the stamp of a
    message sent now. `note` is called with the topic of each message that is received, or sent to a
    node for which the clock waits. `diagnostics` counts messages that cannot be used.
    """

    def __init__(
        self,
        node: Node,
        arm: SimulatedArm,
        seed: int,
        lever_m: float,
        stamp: Callable[[], Time],
        diagnostics: Diagnostics,
        note: Callable[[str], None],
    ) -> None:
        self._stamp, self._note, self._arm = stamp, note, arm
        self._diagnostics = diagnostics
        self._first_step: int | None = None
        self._holding = node.create_publisher(Bool, HOLDING, STATE)
        self._hand = node.create_publisher(JointState, HAND, STATE)
        self._world = ToolboxTransfers(arm, seed, lever_m, self._report)
        node.create_subscription(JointState, TAKES[0], self._on_transfer, STATE)
        for person in (people := named_people(node)) or [""]:
            topic = f"mocap/{person}/wrist/pose" if person else TAKES[1]
            take = partial(self._on_pose, person)
            node.create_subscription(PoseStamped, topic, take, SENSOR)
        if people:
            node.create_subscription(String, "intent/active_person", self._on_person, LATCHED)

    @property
    def held(self) -> str:
        """Label of the object between the fingers, "" if none."""
        return self._world.held

    def set_task(self, task: str) -> None:
        """Set the task being executed, "" when idle."""
        self._world.set_task(task)

    def update(self) -> None:
        """Update the hands and publish who holds what; call this every few milliseconds."""
        self._world.update()
        first = self._first_step  # of the tracker
        if first is None or (self._arm.n_steps - first) % (2 * UPDATE_EVERY):
            return
        contact = self._world.contact()
        message = JointState(name=list(AXES), position=contact.force_n.tolist())
        message.header.stamp, message.header.frame_id = self._stamp(), contact.holder.value
        self._hand.publish(message)
        self._note(HAND)

    def _report(self, holds: bool) -> None:
        self._holding.publish(Bool(data=holds))
        self._note(HOLDING)

    def _on_transfer(self, message: JointState) -> None:
        self._note(TAKES[0])
        try:
            numbers = joint_values(message, ("load_share", "weight", "grip_force"))
            holding = Holding(message.header.frame_id)
        except (MessageError, ValueError) as error:
            self._diagnostics.reject("bad_transfer", one_line(error))
            return
        if not np.all(np.isfinite(numbers)):
            self._diagnostics.reject("not_finite", f"{TAKES[0]} holds NaN or infinity")
            return
        self._world.follow(holding, *numbers.tolist())

    def _on_person(self, message: String) -> None:
        self._world.attend(message.data)

    def _on_pose(self, person: str, message: PoseStamped) -> None:
        position = position_array(message.pose)
        if np.all(np.isfinite(position)):
            self._world.move_wrist(position, person)
            if self._first_step is None:
                self._first_step = self._arm.n_steps // UPDATE_EVERY * UPDATE_EVERY
        self._note(TAKES[1])

# SPDX-License-Identifier: Apache-2.0
"""The wrist and the arm's hand dragged with the mouse, in a real browser, into the real graph."""

import numpy as np
import pytest
from dashboard.browser import Visitor, chromium, free_port, visitor
from geometry_msgs.msg import PoseStamped
from ros_harness import NodeProcess
from sensor_msgs.msg import JointState

from intent_recognition.kinematics.lwr import JOINT_NAMES, hand_position
from intent_recognition.nodes import qos

WRIST, HAND = "/direct/wrist", "/direct/hand"
SHAFT_M = 0.08
"""So far along an axis of the control its shaft is pressed."""
FAR_PIXELS = 60.0
LOST_S = 15.0
"""After so long a drag was lost [s]."""
BY_HAND = "drag both myself"


@pytest.fixture
def cell():
    """An arm and the page in processes of their own; the page's port."""
    chromium()
    port = free_port()
    start = {"sim_bridge.nodes.lwr_sim": [], "intent_recognition.dashboard.node": []}
    start["intent_recognition.dashboard.node"] = ["-p", f"port:={port}", "-p", "rate:=10.0"]
    processes = []
    try:
        for module, parameters in start.items():
            processes.append(NodeProcess(module, "--ros-args", *parameters))
        yield port
    finally:
        for process in processes:
            process.stop()


@pytest.mark.slow
def test_what_is_dragged_on_the_page_moves_in_the_graph(cell, harness):
    wrist, hand = Wrist(harness), Hand(harness)
    with visitor() as person:
        person.open(cell)
        person.wait_for("robot: waits")
        person.tab("Teach")
        person.page.get_by_label("Take the wrist").check()
        person.choose("Show by", BY_HAND)
        for node, follower in ((WRIST, wrist), (HAND, hand)):
            person.wait_until(lambda n=node: person.pixel(n) is not None, f"{node} is drawn")
            follower.wait_for_rest()
            before = follower.position
            for further in (True, True, False):
                along = drag(person, node)
                try:
                    follower.wait_until_moved(before, along)
                    break
                except TimeoutError:  # a browser that draws few frames may lose where it is pressed
                    if not further:
                        raise


def drag(person: Visitor, node: str, far_pixels: float = FAR_PIXELS) -> int:
    """Drag a control along that of its axes which is seen longest; returns which."""
    person.wait_until(lambda: steady(person, node), f"{node} is where it will be")
    origin = person.pixel(node)
    shafts = [person.pixel(node, SHAFT_M * axis) - origin for axis in np.eye(3)]
    along = int(np.argmax([np.linalg.norm(shaft) for shaft in shafts]))
    way = shafts[along] / np.linalg.norm(shafts[along])
    pressed = origin + shafts[along]
    person.drag(pressed, pressed + far_pixels * way)
    return along


def steady(person: Visitor, node: str) -> bool:
    """Whether a control is seen twice at the same place."""
    before = person.pixel(node)
    person.page.wait_for_timeout(300)
    return np.allclose(person.pixel(node), before, atol=0.5)


class Follower:
    """Something of the graph that has a position."""

    TOLERANCE_M = 0.005
    MOVED_M = 0.03

    def __init__(self, harness):
        self._harness = harness
        self.position: np.ndarray | None = None

    def wait_for_rest(self) -> None:
        """Spin until it is where it was half a second ago."""
        self._harness.spin_until(lambda: self.position is not None, what="its position")
        self._harness.spin_until(self._rests, what="rest")

    def _rests(self) -> bool:
        before = self.position
        for _ in range(200):
            self._harness.executor.spin_once(timeout_sec=0.0025)
        return bool(np.linalg.norm(self.position - before) < 1e-3)

    def wait_until_moved(self, before: np.ndarray, along: int) -> None:
        """Spin until it is elsewhere and rests there: far along one axis, not along others."""

        def moved() -> bool:
            return abs(self.position[along] - before[along]) > self.MOVED_M

        self._harness.spin_until(moved, LOST_S, what="a movement")
        self.wait_for_rest()
        across = np.delete(self.position - before, along)
        assert moved()
        assert np.all(np.abs(across) < self.TOLERANCE_M), across


class Wrist(Follower):
    """What the tracker says."""

    def __init__(self, harness):
        super().__init__(harness)
        harness.probe.create_subscription(PoseStamped, "mocap/wrist/pose", self._hear, qos.SENSOR)

    def _hear(self, message: PoseStamped) -> None:
        place = message.pose.position
        self.position = np.array([place.x, place.y, place.z])


class Hand(Follower):
    """Where the arm's hand is, by its joint states."""

    TOLERANCE_M = 0.012
    """The simulated arm is soft."""

    def __init__(self, harness):
        super().__init__(harness)
        harness.probe.create_subscription(JointState, "joint_states", self._hear, qos.STATE)

    def _hear(self, message: JointState) -> None:
        angle = dict(zip(message.name, message.position, strict=True))
        self.position = hand_position(np.array([angle[name] for name in JOINT_NAMES]))

# SPDX-License-Identifier: Apache-2.0
"""An arm that was not taught, and what nodes must know where objects are handed over by force."""

from functools import cached_property

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import Arm
from sim_bridge.arm import Robot, find_robot
from sim_bridge.coworker import HOLD
from sim_bridge.handover import finger_joints, with_fingers
from sim_bridge.scenarios.toolbox.scene import GRASP_RADIUS_M, HOME_HAND_M, STANDS_M


class ToolboxArm:
    """What a scenario needs to know of an arm whose hand waits at a place (3,), world."""

    def __init__(self, robot: Robot, home_m: Floats = HOME_HAND_M):
        self.robot, self._home_m = robot, home_m
        self._arm = Arm.from_urdf(robot.description, base="world", tip=robot.tip, rest=robot.ready)

    @cached_property
    def home(self) -> Floats:
        """Posture with the hand where it waits, near the ready one (n,) [rad].

        Raises:
            KinematicsError: it is out of reach.
        """
        return self._arm.inverse_kinematics(self._home_m)

    def n_reached(self, places_m: Floats) -> int:
        """How many places (n, 3), world, the hand reaches to 1 cm."""
        near = (self._arm.nearest(place, self.home).distance_m for place in places_m)
        return sum(distance_m <= 0.01 for distance_m in near)

    def hand(self, q: Floats) -> Floats:
        """Positions of the hand in the world (..., 3) [m] for measured joints, fingers last."""
        return self._arm.forward_kinematics(q[..., : self.robot.n_joints])[..., :3, 3]


ONE_HOLDS_S = (5.0, 6.0)
"""How long the only worker waits where a hand was stretched out [s]: the arm is late, and both take
their time."""


def by_force_with(robot: Robot, hold_s: tuple[float, float]) -> dict[str, dict[str, object]]:
    """Parameters by node for an arm with fingers, and how long a worker waits at least and most."""
    # so slow [m/s] that it takes the object: below `GRASP_SPEED_M_S`
    slow = [f"{x} {y} {z} {GRASP_RADIUS_M} 0.1" for x, y, z in STANDS_M.values()]
    fingers = finger_joints(robot)
    return {
        "object_transfer": {"takes": [HOLD], "fingers": fingers, "hand_link": robot.tip},
        "coworker_sim": {"hold": list(hold_s)},
        "primitive_activation": {"slow_at": slow},
    }


def handing_over(arm: str) -> dict[str, dict[str, object]]:
    """Parameters by node for one worker and an arm, see `find_robot`; the LWR where it is empty.

    Raises:
        IntentError: there is no such arm, or its hand does not reach where it waits.
    """
    robot = _with_fingers(arm)
    own = by_force_with(robot, ONE_HOLDS_S)
    if arm:
        home = ToolboxArm(robot).home.tolist()
        hand: dict[str, object] = {"hand_link": robot.tip}
        own |= {"intent_estimator": hand, "dashboard": hand, "task_teacher": hand}
        own["arm_sim"] = {"initial_position": home}
        own["primitive_activation"] |= hand | {"home": home}
    return own


def describe_with_fingers(arm: str) -> str:
    """URDF for viewers of that arm, which the arm's node publishes, too."""
    return _with_fingers(arm).description


def _with_fingers(arm: str) -> Robot:
    return with_fingers(find_robot(arm or "lwr"))

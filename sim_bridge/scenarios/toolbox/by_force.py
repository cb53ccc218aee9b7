# SPDX-License-Identifier: Apache-2.0
"""Parameters of the nodes for handing the toolbox's objects over by force."""

from sim_bridge.arm import Robot, find_robot
from sim_bridge.coworker import HOLD
from sim_bridge.handover import finger_joints, with_fingers
from sim_bridge.scenarios.toolbox.other_arms import ToolboxArm
from sim_bridge.scenarios.toolbox.scene import GRASP_RADIUS_M, STANDS_M

ONE_HOLDS_S = (5.0, 6.0)
"""Shortest and longest time that a single worker waits with a hand held out [s], so that the arm
can arrive late and the handover can take its time."""


def by_force_with(robot: Robot, hold_s: tuple[float, float]) -> dict[str, dict[str, object]]:
    """Parameters by node for an arm with fingers; a worker waits for a time within `hold_s`."""
    # 0.1 m/s, below `GRASP_SPEED_M_S`, so that the hand takes the object
    slow = [f"{x} {y} {z} {GRASP_RADIUS_M} 0.1" for x, y, z in STANDS_M.values()]
    fingers = finger_joints(robot)
    return {
        "object_transfer": {"takes": [HOLD], "fingers": fingers, "hand_link": robot.tip},
        "coworker_sim": {"hold": list(hold_s)},
        "primitive_activation": {"slow_at": slow},
    }


def handing_over(arm: str) -> dict[str, dict[str, object]]:
    """Parameters by node for one worker and an arm (see `find_robot`; the LWR if empty).

    Raises:
        IntentError: there is no such arm, or its hand cannot reach the place where it waits.
    """
    robot = with_fingers(find_robot(arm or "lwr"))
    own = by_force_with(robot, ONE_HOLDS_S)
    if arm:
        home = ToolboxArm(robot).home.tolist()
        hand: dict[str, object] = {"hand_link": robot.tip}
        own |= {"intent_estimator": hand, "dashboard": hand, "task_teacher": hand}
        own["arm_sim"] = {"initial_position": home}
        own["primitive_activation"] |= hand | {"home": home}
    return own


def describe_with_fingers(arm: str) -> str:
    """URDF for viewers of an arm with fingers, as the arm's node publishes it."""
    return with_fingers(find_robot(arm or "lwr")).description

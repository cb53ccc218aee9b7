# SPDX-License-Identifier: Apache-2.0
"""Two fingers that hold by force: the arm's own, or a simple gripper at the end of its hand."""

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import parse_xml
from intent_recognition.transfer import Holding
from sim_bridge import GRAVITY_M_S2
from sim_bridge.arm import Robot, SimulatedArm, add_inertial, add_joint, text_of
from sim_bridge.physics import pybullet

GRIP_LINK = "grip"
"""Link between the pads of an added gripper, its grip."""
FINGERS = ("grip_finger_left", "grip_finger_right")
"""Joints of an added gripper."""
PALM_M, FINGER_M = (0.05, 0.12, 0.03), (0.024, 0.012, 0.07)
"""Palm and fingers of an added gripper: width, length in the direction of closing, depth [m]. It is
smaller than a Franka Hand, with pads as wide."""
OPENING_M = 0.04
"""Largest distance of a finger from the middle [m], as in the Franka Hand."""
GRIP_M = PALM_M[2] + FINGER_M[2] - 0.015
"""Distance from the link that carries the gripper to the grip, near the middle of a pad [m]."""
CLOSING_M_S, OPENING_M_S = 0.1, 0.15
"""Speeds of the fingers [m/s]; the Franka Hand has at most 0.1 and 0.2."""
GEAR_N = 500.0
"""Force that keeps both fingers equally far from the middle [N], much larger than they press."""


def with_fingers(robot: Robot) -> Robot:
    """The arm itself if it has two fingers, else the arm with a gripper, whose grip is the tip."""
    if len(finger_joints(robot)) == 2:
        return robot
    urdf, description = (_add(text, robot.tip) for text in (robot.urdf, robot.description))
    return replace(robot, urdf=urdf, description=description, tip=GRIP_LINK)


def finger_joints(robot: Robot) -> list[str]:
    """Names of an arm's finger joints: an added gripper's, or else all prismatic ones."""
    joints = parse_xml(robot.urdf).findall("joint[@type='prismatic']")
    names = [joint.get("name", "") for joint in joints]
    return _that_grip([name for name in names if name not in robot.joint_names])


def _that_grip(names: list[str]) -> list[str]:
    """The joints of an added gripper if they are among the names, else all names."""
    return list(FINGERS) if FINGERS[0] in names else names


class Fingers:
    """The two fingers of a simulated arm, pressed together by a force.

    Raises:
        ArgumentError: the arm does not have two sliding fingers.
    """

    def __init__(self, arm: SimulatedArm) -> None:
        self._client, self._body = arm.client, arm.body
        joints = (
            arm.client.getJointInfo(arm.body, k) for k in range(arm.client.getNumJoints(arm.body))
        )
        numbers = {j[1].decode(): j[0] for j in joints if j[2] == pybullet.JOINT_PRISMATIC}
        found = _that_grip([name for name in arm.others.names if name in numbers])
        self.links = tuple(numbers[name] for name in found)
        if len(self.links) != 2:
            cure = "Give it a gripper by `with_fingers`."
            raise ArgumentError.about("arm", "two fingers", arm.others.names, cure)
        for link in self.links:
            # Soft pads: hard faces hold by one edge, and objects rock with less damping.
            self._client.changeDynamics(
                self._body,
                link,
                lateralFriction=1.0,
                frictionAnchor=False,
                spinningFriction=0.015 * 2.0 / 3.0,  # two thirds of the radius of a soft pad
                contactStiffness=2e4,  # 1 mm at the strongest grip
                contactDamping=1000.0,  # as in the Panda's URDF
            )
            self._client.resetJointState(self._body, link, OPENING_M)
        gear = self._client.createConstraint(
            self._body, self.links[0], self._body, self.links[1], pybullet.JOINT_GEAR,
            [0.0, 1.0, 0.0], [0.0] * 3, [0.0] * 3,
        )  # fmt: skip
        self._client.changeConstraint(gear, gearRatio=-1, erp=0.2, maxForce=GEAR_N)
        self.press(0.0)

    def press(self, force_n: float) -> None:
        """Press each finger inward with a force [N]; 0 opens them."""
        for link in self.links:
            if force_n > 0.0:
                aim = {"targetVelocity": -CLOSING_M_S, "force": force_n}
            elif self.half_opening_m() < OPENING_M - 0.002:
                aim = {"targetVelocity": OPENING_M_S, "force": GEAR_N}
            else:
                aim = {"targetVelocity": 0.0, "force": GEAR_N}
            self._client.setJointMotorControl2(self._body, link, pybullet.VELOCITY_CONTROL, **aim)

    def close_on(self, half_width_m: float) -> None:
        """Put each finger at a distance from the middle at once, onto an object between them."""
        for link in self.links:
            self._client.resetJointState(self._body, link, half_width_m)

    def half_opening_m(self) -> float:
        """Mean distance of the fingers from the middle [m]."""
        states = self._client.getJointStates(self._body, self.links)
        return 0.5 * float(states[0][0] + states[1][0])

    def touching(self, body: int) -> int:
        """Number of fingers that touch a body."""
        contacts = self._client.getContactPoints(self._body, body) or ()
        return len({contact[3] for contact in contacts} & set(self.links))


def _add(text: str, tip: str) -> str:
    """A URDF with the gripper fixed to a link, pointing along its z."""
    root = parse_xml(text)
    palm = _link(root, "grip_palm", PALM_M, (0.0, 0.0, 0.5 * PALM_M[2]), 0.35)
    add_joint(root, "grip_palm_joint", "fixed", tip, palm, (0.0, 0.0, 0.0))
    for name, side in zip(FINGERS, (1.0, -1.0), strict=True):
        centre = (0.0, 0.5 * side * FINGER_M[1], 0.5 * FINGER_M[2])
        finger = _link(root, f"{name}_link", FINGER_M, centre, 0.05)
        joint = add_joint(root, name, "prismatic", palm, finger, (0.0, 0.0, PALM_M[2]))
        ET.SubElement(joint, "axis", xyz=f"0 {side} 0")
        limit = {"lower": "0", "upper": str(OPENING_M), "effort": "100", "velocity": "0.2"}
        ET.SubElement(joint, "limit", limit)
    grip = _link(root, GRIP_LINK, None, (0.0, 0.0, 0.0), 0.0)
    add_joint(root, "grip_joint", "fixed", palm, grip, (0.0, 0.0, GRIP_M))
    return ET.tostring(root, encoding="unicode")


def _link(
    root: ET.Element,
    name: str,
    size_m: tuple[float, float, float] | None,
    centre_m: tuple[float, float, float],
    mass_kg: float,
) -> str:
    link = ET.SubElement(root, "link", name=name)
    squares = np.square(size_m or (0.0, 0.0, 0.0))
    add_inertial(link, mass_kg, centre_m, mass_kg / 12.0 * (squares.sum() - squares))
    for kind in ("visual", "collision") if size_m else ():
        shape = ET.SubElement(link, kind)
        ET.SubElement(shape, "origin", xyz=text_of(centre_m), rpy="0 0 0")
        ET.SubElement(ET.SubElement(shape, "geometry"), "box", size=text_of(size_m or ()))
    return name


CARRIED = (Holding.CARRYING, Holding.OFFERING, Holding.RETURNING)


class GripFollower:
    """Presses the fingers, and compensates the weight that the person has not taken over."""

    def __init__(self, arm: SimulatedArm, fingers: Fingers) -> None:
        self._arm, self._fingers, self._payload_n = arm, fingers, 0.0

    def follow(
        self, holding: Holding, share: float, weight_n: float, grip_n: float, step_s: float
    ) -> None:
        """Apply a command, `step_s` after the last one."""
        self._fingers.press(grip_n)
        wanted_n = weight_n * (1.0 - share) if holding in CARRIED else 0.0
        # slower than the measurement, faster than people give up a load
        reach_n = np.inf if holding in (Holding.EMPTY, Holding.RELEASING) else 40.0 * step_s
        self._payload_n += float(np.clip(wanted_n - self._payload_n, -reach_n, reach_n))
        self._arm.set_payload(max(self._payload_n, 0.0) / GRAVITY_M_S2)

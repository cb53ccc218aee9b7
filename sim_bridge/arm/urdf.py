# SPDX-License-Identifier: Apache-2.0
"""The LWR 4+ as a URDF built from boxes, cylinders and spheres; no mesh files.

Link i has the axes of joint i (z = joint axis); joint i+1 sits at Tz(d_i) Rx(alpha_i) in it, so
that the tree is the Denavit-Hartenberg chain of `kinematics.lwr` by construction. The frame
`lwr_hand` is DH frame 7. Masses are those of the public models; inertias are computed from solid
cylinders, because the published ones of links 1, 6 and 7 are implausible (see `LINK_BODIES`).
"""

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from intent_recognition.kinematics import DH, JOINT_NAMES, LWR_LIMITS, N_JOINTS
from sim_bridge.arm.urdf_shapes import BASE_SHAPES, HAND_SHAPES, LINK_SHAPES, LinkShape

WORLD_LINK = "world"
BASE_LINK = "lwr_base_link"
LINK_NAMES: tuple[str, ...] = tuple(f"lwr_a{i}_link" for i in range(1, N_JOINTS + 1))
HAND_LINK = "lwr_hand"

# Inertia of each rotor seen through its gear [kg m^2]; values of ours, in the range usual for
# harmonic drives with 1:100 gears in joints of this size.
ROTOR_INERTIA_KG_M2: tuple[float, ...] = (0.20, 0.20, 0.12, 0.12, 0.08, 0.04, 0.04)
"""Inertia of each motor behind its gear [kg m^2]: estimates by size, no measurement."""


@dataclass(frozen=True)
class LinkBody:
    """One link as a solid cylinder: mass [kg], centre [m], direction of its axis, size [m]."""

    mass: float
    centre: tuple[float, float, float]
    axis: str
    radius: float
    length: float

    def inertia(self) -> NDArray[np.float64]:
        """Return the moments of inertia about the centre along the link's axes (3,) [kg m^2]."""
        across = self.mass * (3.0 * self.radius**2 + self.length**2) / 12.0
        moments = np.full(3, across)
        moments["xyz".index(self.axis)] = 0.5 * self.mass * self.radius**2
        return moments


LINK_BODIES: tuple[LinkBody, ...] = (
    LinkBody(2.3, (0.0, 0.0, 0.21), "z", 0.065, 0.20),
    LinkBody(2.3, (0.0, 0.09, 0.0), "y", 0.065, 0.22),
    LinkBody(2.3, (0.0, 0.0, 0.30), "z", 0.065, 0.20),
    LinkBody(2.3, (0.0, -0.09, 0.0), "y", 0.065, 0.22),
    LinkBody(1.6, (0.0, 0.0, 0.29), "z", 0.060, 0.18),
    LinkBody(1.5, (0.0, 0.0, 0.0), "z", 0.060, 0.12),
    LinkBody(0.3, (0.0, 0.0, 0.06), "z", 0.035, 0.036),
)
BASE_MASS_KG = 1.21
"""Mass of the fixed base [kg]; of no effect on the dynamics."""


def link_inertia(index: int, rotor_inertia: float) -> NDArray[np.float64]:
    """Return moments (3,) [kg m^2] of link `index` with its rotor.

    The rotor is a massless disc across the joint axis: J about the axis, J/2 across it (a body
    with J about one axis only does not exist, and PyBullet zeroes such an inertia). Everything
    that uses the model (simulation, contacts, inverse dynamics, viewers) thus sees the same
    inertia. The price: joints further down the chain feel it too where their axes line up,
    at most J, where a real 1:100 gear would pass on a hundredth of it.
    """
    return LINK_BODIES[index].inertia() + rotor_inertia * np.array([0.5, 0.5, 1.0])


def end_of(joint: ET.Element, end: str) -> str:
    """Parent or child link of a joint; empty where none is named."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def lwr_urdf(*, world: bool = False) -> str:
    """Return the arm's URDF as text.

    Args:
        world: begin at the link `world`, to which the base is fixed: for robot_state_publisher,
            whose tree then reaches the frame of all positions and has no root with an inertia.
    """
    robot = ET.Element("robot", name="lwr")
    if world:
        ET.SubElement(robot, "link", name=WORLD_LINK)
        add_joint(robot, "lwr_base_joint", "fixed", WORLD_LINK, BASE_LINK, (0.0, 0.0, 0.0))
    base = ET.SubElement(robot, "link", name=BASE_LINK)
    add_inertial(base, BASE_MASS_KG, (0.0, 0.0, 0.055), np.full(3, 0.004))
    _add_shapes(base, BASE_SHAPES)
    for i, name in enumerate(LINK_NAMES):
        link = ET.SubElement(robot, "link", name=name)
        body = LINK_BODIES[i]
        add_inertial(link, body.mass, body.centre, link_inertia(i, ROTOR_INERTIA_KG_M2[i]))
        shapes = LINK_SHAPES[i] + (HAND_SHAPES if i == N_JOINTS - 1 else ())
        _add_shapes(link, shapes)
        _add_joint(robot, i)
    # Without an inertial, PyBullet would give the frame a mass of 1 kg.
    add_inertial(ET.SubElement(robot, "link", name=HAND_LINK), 0.0, (0.0,) * 3, np.zeros(3))
    tip = (0.0, 0.0, DH.d_m[-1])
    add_joint(robot, "lwr_hand_joint", "fixed", LINK_NAMES[-1], HAND_LINK, tip)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def add_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, xyz: tuple[float, ...]
) -> ET.Element:
    """Add a joint of a kind, whose child has the axes of its parent and is at xyz in it [m]."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=text_of(xyz), rpy="0 0 0")
    return joint


def _add_joint(robot: ET.Element, i: int) -> None:
    joint = ET.SubElement(robot, "joint", name=JOINT_NAMES[i], type="revolute")
    ET.SubElement(joint, "parent", link=LINK_NAMES[i - 1] if i else BASE_LINK)
    ET.SubElement(joint, "child", link=LINK_NAMES[i])
    offset = (0.0, 0.0, DH.d_m[i - 1] if i else 0.0)
    turn = (DH.alpha_rad[i - 1] if i else 0.0, 0.0, 0.0)
    ET.SubElement(joint, "origin", xyz=text_of(offset), rpy=text_of(turn))
    ET.SubElement(joint, "axis", xyz="0 0 1")
    ET.SubElement(
        joint,
        "limit",
        lower=repr(float(LWR_LIMITS.lower[i])),
        upper=repr(float(LWR_LIMITS.upper[i])),
        effort=repr(float(LWR_LIMITS.torque[i])),
        velocity=repr(float(LWR_LIMITS.velocity[i])),
    )
    ET.SubElement(joint, "dynamics", damping="0", friction="0")


def add_inertial(
    link: ET.Element, mass: float, centre: tuple[float, ...], moments: NDArray[np.float64]
) -> None:
    """Add mass [kg], its centre [m] and its moments of inertia (3,) [kg m^2] along the axes."""
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text_of(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(mass)))
    names = ("ixx", "iyy", "izz")
    values = {name: repr(float(value)) for name, value in zip(names, moments, strict=True)}
    ET.SubElement(inertial, "inertia", {**values, "ixy": "0", "ixz": "0", "iyz": "0"})


def _add_shapes(link: ET.Element, shapes: tuple[LinkShape, ...]) -> None:
    for shape in shapes:
        for kind in ("visual", "collision") if shape.collides else ("visual",):
            element = ET.SubElement(link, kind)
            ET.SubElement(element, "origin", xyz=text_of(shape.xyz), rpy=text_of(shape.rpy))
            geometry = ET.SubElement(element, "geometry")
            ET.SubElement(geometry, shape.kind, shape.size)
            if kind == "visual":
                material = ET.SubElement(element, "material", name=shape.colour_name)
                ET.SubElement(material, "color", rgba=text_of(shape.rgba))


def text_of(values: tuple[float, ...]) -> str:
    """Numbers as a URDF has them."""
    return " ".join(repr(float(value)) for value in values)

# SPDX-License-Identifier: Apache-2.0
"""The shipped URDF of the LWR 4+, and how a URDF is added to."""

from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from intent_recognition.share import share_path

LWR_URDF = "config/robots/lwr.urdf"
"""Place of the shipped LWR 4+."""


def lwr_urdf() -> str:
    """The LWR's URDF as text; `describe_robot` gives it for viewers."""
    return share_path(LWR_URDF).read_text(encoding="utf-8")


def end_of(joint: ET.Element, end: str) -> str:
    """Parent or child link of a joint; empty where none is named."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def add_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, xyz: tuple[float, ...]
) -> ET.Element:
    """Add a joint of a kind, whose child has the axes of its parent and is at xyz in it [m]."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=text_of(xyz), rpy="0 0 0")
    return joint


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


def text_of(values: tuple[float, ...]) -> str:
    """Numbers as a URDF has them."""
    return " ".join(repr(float(value)) for value in values)

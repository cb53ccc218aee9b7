# SPDX-License-Identifier: Apache-2.0
"""The arms that can be simulated: the LWR, those of PyBullet's data, and any URDF.

An arm other than the LWR gets what its URDF does not hold from its torque limits, in the
proportions of the LWR's values: stiffness, friction while guided, and the inertia of the motors
behind their gears, without which light wrists cannot be controlled at 1 kHz.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import (
    DEFAULT_ACCELERATION_RAD_S2,
    JOINT_NAMES,
    JointLimits,
    package_shares,
    parse_urdf,
    parse_xml,
    read_chain,
    read_urdf,
)
from intent_recognition.share import share_path
from sim_bridge.arm.controllers import ControllerGains
from sim_bridge.arm.urdf import LWR_URDF, end_of

LARGEST_TORQUE_NM = 100.0
"""Torque limit from which on stiffness and rotors do not grow [Nm]: URDFs often exaggerate it.
Convention: that of the LWR's middle joints."""
ROTOR_KG_M2_PER_NM = 1.1e-3
"""Inertia of a motor behind its gear by torque limit [kg m^2/Nm]: the LWR's."""
STIFFNESS_PER_RAD = 1.2
"""Stiffness by torque limit [1/rad]: that of the LWR's large joints."""
DAMPING_RATIO = 0.8
"""Of a joint alone in the ready posture. Convention."""
BLOCK_WIDTH_M = 0.2
"""Of the block that is drawn below a raised base [m]. Convention: wider than a small arm's foot."""
WORLD = "world"
"""Root link of a description."""
READY_POSITION: tuple[float, ...] = (0.0, -0.45, 0.0, 1.55, 0.0, -1.1415926535897931, 0.0)
"""The LWR's joint angles [rad] with the elbow up and the hand in front of the base, fingers down:
all limits are far away. Convention."""


@dataclass(frozen=True, eq=False)
class Robot:
    """An arm as the simulation needs it.

    Attributes:
        name: what it is called.
        urdf: text with the paths of its meshes made absolute, as PyBullet reads it.
        description: the same for viewers, beginning at the link `world`.
        tip: link that is the hand.
        joint_names: joints of the chain, from the base on.
        limits: theirs.
        ready: posture to begin in (n,) [rad].
        base_position_m: where the base stands in the world (3,).
        gains: of its controllers; None: from torque limits and inertia.
        source: text of a URDF with the same joints; `find_robot` makes the same arm of it.
        assumed: joints whose URDF has no limit of speed or effort; they have the defaults.
    """

    name: str
    urdf: str
    description: str
    tip: str
    joint_names: tuple[str, ...]
    limits: JointLimits
    ready: NDArray[np.float64]
    base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gains: ControllerGains | None = None
    source: str = ""
    assumed: tuple[str, ...] = ()

    @property
    def n_joints(self) -> int:
        """Number of joints of the chain."""
        return len(self.joint_names)


class Preset(NamedTuple):
    """An arm that needs no file of the user's.

    Attributes:
        file: of this package's share, or else of PyBullet's data.
        tip: link that is the hand.
        ready: posture to begin in [rad].
        base_position_m: where the base stands.
    """

    file: str
    tip: str
    ready: tuple[float, ...]
    base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def path(self) -> Path:
        """Of the file."""
        if self.file.startswith("config"):
            return share_path(self.file)
        import pybullet_data

        return Path(pybullet_data.getDataPath()) / self.file


PRESETS = {
    "lwr": Preset(LWR_URDF, "lwr_hand", READY_POSITION),
    # The tip is between the fingers.
    "panda": Preset(
        "franka_panda/panda.urdf", "panda_grasptarget", (0.0, -0.3, 0.0, -2.2, 0.0, 3.0, 0.785)
    ),
    "iiwa": Preset(
        "kuka_iiwa/model.urdf", "lbr_iiwa_link_7", (0.0, 0.5, 0.0, -1.7, 0.0, -0.6, 0.0)
    ),
    # A short arm: it stands nearer to the worker, on a block.
    "xarm": Preset(
        "xarm/xarm6_robot.urdf", "link6", (0.0, -0.3, -0.9, 0.0, -0.3, 0.0), (0.12, 0.0, 0.05)
    ),
}
"""Arms by name."""
NAMES = tuple(PRESETS)
"""Their names."""


def find_robot(
    robot: str, *, base: str = "", tip: str = "", base_position_m: Sequence[float] | None = None
) -> Robot:
    """An arm by its name, or from the path of a URDF or xacro file.

    Joints that neither move the hand nor hang on it, such as wheels, a head and another arm, are
    held at zero; so are those below `base`.

    Args:
        robot: one of `NAMES`, or a path.
        base: link from which on joints belong to the arm; the root by default.
        tip: link that is the hand; by default the preset's, or that of `Arm.from_urdf`.
        base_position_m: where the base stands in the world (3,); by default the preset's.

    Raises:
        ArgumentError: neither, or the URDF cannot be used.
    """
    preset = PRESETS.get(robot)
    path = Path(robot) if preset is None else preset.path
    if not path.is_file():
        expected = f"one of {', '.join(NAMES)}, or the path of a URDF or xacro file"
        raise ArgumentError.about("robot", expected, robot, "Choose one.")
    usual = preset or Preset("", "", ())
    at = _position(usual.base_position_m if base_position_m is None else base_position_m)
    text = with_meshes(read_urdf(path), path.resolve().parent)
    chain = read_chain(text, base or None, tip or usual.tip or None, DEFAULT_ACCELERATION_RAD_S2)
    text = with_others_held(text, chain.names)
    copies = [mimic.joint for mimic in chain.mimics if mimic.master in chain.names]
    if copies:
        cure = "Choose a tip before it."
        raise ArgumentError.about("robot", "a chain without mimic joints", copies[0], cure)
    middle = 0.5 * (chain.limits.lower + chain.limits.upper)
    ready = np.where(chain.continuous, 0.0, middle)
    if len(usual.ready) == len(chain.names):
        ready = np.array(usual.ready)
    own_rotors = robot == "lwr"
    simulated = text if own_rotors else with_rotors(text, chain.names, chain.limits.torque)
    return Robot(
        path.stem if preset is None else robot,
        simulated,
        with_world(simulated, at),
        chain.tip,
        chain.names,
        chain.limits,
        ready,
        at,
        ControllerGains() if chain.names == JOINT_NAMES else None,
        text,
        chain.assumed,
    )


def describe_robot(robot: str = "") -> str:
    """URDF for viewers of an arm, by name or path; the LWR's if it is empty."""
    return find_robot(robot or "lwr").description


def derived_gains(torque: NDArray[np.float64], inertia: NDArray[np.float64]) -> ControllerGains:
    """Gains of an arm that is not the LWR.

    Args:
        torque: limits (n,) [Nm].
        inertia: of each joint alone in the ready posture (n,) [kg m^2].
    """
    torque = np.minimum(torque, LARGEST_TORQUE_NM)
    stiffness = STIFFNESS_PER_RAD * torque
    return ControllerGains(
        stiffness=stiffness,
        damping=2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia),
        guide_damping=0.01 * torque,
        guide_friction=np.zeros(len(torque)),
        limit_stiffness=8.0 * torque,
        limit_damping=0.17 * torque,
    )


def with_others_held(text: str, joint_names: Sequence[str]) -> str:
    """A URDF in which only the joints of an arm move, and those of what its last link carries."""
    root = parse_urdf(text)
    joints = root.findall("joint[@type]")
    (carrier,) = (end_of(j, "child") for j in joints if j.get("name") == joint_names[-1])
    carried, added = {carrier}, 1
    while added:
        beyond = {end_of(j, "child") for j in joints if end_of(j, "parent") in carried} - carried
        carried, added = carried | beyond, len(beyond)
    for joint in joints:
        if joint.get("name") not in joint_names and end_of(joint, "parent") not in carried:
            joint.set("type", "fixed")
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)
    return ET.tostring(root, encoding="unicode")


def with_meshes(text: str, folder: Path) -> str:
    """A URDF whose meshes are named by absolute paths.

    Args:
        text: of the URDF.
        folder: that it is in.

    Raises:
        ArgumentError: it is no XML, or a mesh is nowhere.
    """
    root = parse_xml(text)
    for mesh in root.iter("mesh"):
        mesh.set("filename", str(_find_mesh(mesh.get("filename", ""), folder)))
    return ET.tostring(root, encoding="unicode")


def _find_mesh(name: str, folder: Path) -> Path:
    """A mesh beside the URDF, in a folder above it, or in an installed ROS package."""
    _, scheme, rest = name.rpartition("://")
    shares = map(Path, package_shares()) if scheme else ()
    places = [folder, *folder.parents[:3], *shares]
    for place in places:
        with suppress(OSError):  # such as a name that is too long
            if (place / rest).is_file():
                return (place / rest).resolve()
    cure = "Source the workspace that has its package, or put it beside the URDF."
    raise ArgumentError.about("robot", f"the mesh {name}", "no such file", cure)


def with_rotors(text: str, joint_names: Sequence[str], torque: NDArray[np.float64]) -> str:
    """A URDF whose links have the inertia of their joints' motors.

    As massless discs: J about the joint's axis, J/2 across it, since a body with J about one axis
    only does not exist, and PyBullet zeroes such an inertia. Joints further down the chain feel it
    too where their axes line up: at most J, where a real gear of 1:100 passes on a hundredth.
    """
    root = parse_xml(text)
    links = {link.get("name"): link for link in root.findall("link")}
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    rotors = ROTOR_KG_M2_PER_NM * np.minimum(torque, LARGEST_TORQUE_NM)
    for name, rotor in zip(joint_names, rotors, strict=True):
        joint = joints[name]
        if joint.get("type") == "prismatic":
            continue
        axis, link = joint.find("axis"), links[end_of(joint, "child")]
        direction = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
        _add_rotor(link, direction / np.linalg.norm(direction), float(rotor))
    return ET.tostring(root, encoding="unicode")


def _add_rotor(link: ET.Element, axis: NDArray[np.float64], rotor: float) -> None:
    """Add to a link's inertia, which is along the axes of its inertial frame."""
    inertial = link.find("inertial")
    inertia = None if inertial is None else inertial.find("inertia")
    if inertial is None or inertia is None:
        cure = "Write its <inertial> into the URDF: without mass and inertia nothing moves."
        raise ArgumentError.about(link.get("name", "link"), "an inertia", "none", cure)
    origin = inertial.find("origin")
    rpy = _numbers("0 0 0" if origin is None else origin.get("rpy", "0 0 0"))
    axis = Rotation.from_euler("xyz", rpy).inv().apply(axis)
    added = 0.5 * rotor * (np.eye(3) + np.outer(axis, axis))
    for i, j, key in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy")) + (
        (0, 2, "ixz"),
        (1, 2, "iyz"),
    ):
        inertia.set(key, repr(float(inertia.get(key, "0")) + float(added[i, j])))


def with_world(text: str, base_position_m: tuple[float, float, float]) -> str:
    """A URDF for viewers: the root is `world`, meshes are URIs; a raised base stands on a block."""
    root = parse_xml(text)
    links, joints = root.findall("link"), root.findall("joint[@type]")
    children = {end_of(joint, "child") for joint in joints}
    base = next(name for name in (link.get("name", "") for link in links) if name not in children)
    if base != WORLD:
        root.insert(0, ET.Element("link", name=WORLD))
        joint = ET.SubElement(root, "joint", name="world_to_base", type="fixed")
        ET.SubElement(joint, "parent", link=WORLD)
        ET.SubElement(joint, "child", link=base)
        joints.append(joint)
    for joint in joints:
        if end_of(joint, "parent") == WORLD:
            origin = joint.find("origin")
            origin = ET.SubElement(joint, "origin") if origin is None else origin
            moved = _numbers(origin.get("xyz", "0 0 0")) + base_position_m
            origin.set("xyz", " ".join(map(repr, moved.tolist())))
    for mesh in root.iter("mesh"):
        mesh.set("filename", Path(mesh.get("filename", "")).as_uri())
    if base_position_m[2] > 0.0:
        world = next(link for link in root.findall("link") if link.get("name") == WORLD)
        world.append(_block(*base_position_m))
    return ET.tostring(root, encoding="unicode")


def _block(x: float, y: float, height: float) -> ET.Element:
    """What is drawn from the ground to a base."""
    visual = ET.Element("visual")
    ET.SubElement(visual, "origin", xyz=f"{x} {y} {0.5 * height}")
    size = f"{BLOCK_WIDTH_M} {BLOCK_WIDTH_M} {height}"
    ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=size)
    ET.SubElement(ET.SubElement(visual, "material", name="block"), "color", rgba="0.4 0.44 0.48 1")
    return visual


def _numbers(text: str) -> NDArray[np.float64]:
    return np.array([float(number) for number in text.split()])


def _position(position_m: Sequence[float]) -> tuple[float, float, float]:
    if len(position_m) != 3 or not np.all(np.isfinite(position_m)):
        raise ArgumentError.about("base_position_m", "x, y, z", position_m, "In metres.")
    return float(position_m[0]), float(position_m[1]), float(position_m[2])

# SPDX-License-Identifier: Apache-2.0
"""Change a URDF for the simulation and for viewers."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import combinations_with_replacement
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.kinematics import link_of, package_shares, packages_around

WORLD = "world"
"""Root link of a description."""
MESH_KINDS = (".dae", ".obj", ".stl")
"""Suffixes of meshes that PyBullet reads."""
DEFAULT_MASS_KG, DEFAULT_INERTIA = 2.0, 0.01
"""Mass and moments of inertia [kg m^2] of a moving link without any in the URDF: those of a ball of
11 cm radius, like the middle links of cobots."""
JAW = 0.1, 1e-4
"""Mass and moments of inertia [kg m^2] of such a link in a gripper, like the Panda's finger."""


def add_joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, xyz: tuple[float, ...]
) -> ET.Element:
    """Add a joint whose child has the axes of its parent and is at `xyz` in its frame [m]."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=text_of(xyz), rpy="0 0 0")
    return joint


def add_inertial(link: ET.Element, mass: float, centre: tuple[float, ...], moments: Floats) -> None:
    """Add a mass [kg] with its centre [m] and moments of inertia (3,) [kg m^2] about the axes."""
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text_of(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(float(mass)))
    names = ("ixx", "iyy", "izz")
    values = {name: repr(float(value)) for name, value in zip(names, moments, strict=True)}
    ET.SubElement(inertial, "inertia", {**values, "ixy": "0", "ixz": "0", "iyz": "0"})


def text_of(values: tuple[float, ...]) -> str:
    """Numbers as text in the format of a URDF."""
    return " ".join(repr(float(value)) for value in values)


def written(root: ET.Element) -> str:
    """A URDF as text."""
    return ET.tostring(root, encoding="unicode")


def hold_others(root: ET.Element, joint_names: Sequence[str]) -> None:
    """Fix all joints but those of an arm and those that its last link carries."""
    joints = root.findall("joint[@type]")
    (carrier,) = (link_of(j, "child") for j in joints if j.get("name") == joint_names[-1])
    carried, added = {carrier}, 1
    while added:
        beyond = {link_of(j, "child") for j in joints if link_of(j, "parent") in carried} - carried
        carried, added = carried | beyond, len(beyond)
    for joint in joints:
        if joint.get("name") not in joint_names and link_of(joint, "parent") not in carried:
            joint.set("type", "fixed")
            for mimic in joint.findall("mimic"):
                joint.remove(mimic)


def find_meshes(root: ET.Element, folder: Path) -> tuple[str, ...]:
    """Replace the mesh names of a URDF in this folder by absolute paths.

    Shapes whose mesh is not found, or of a kind that PyBullet cannot read, are left out; returns
    the names of these meshes.
    """
    around = packages_around(folder)
    missing = []
    for link in root.findall("link"):
        for shape in list(link):
            for mesh in shape.iter("mesh"):
                name = mesh.get("filename", "")
                if path := _find_mesh(name, folder, around):
                    mesh.set("filename", str(path))
                else:
                    missing.append(name)
                    link.remove(shape)
                    break
    return tuple(dict.fromkeys(missing))


def _find_mesh(name: str, folder: Path, around: Mapping[str, Path]) -> Path | None:
    """Find a mesh beside the URDF, in a folder above it, or in a ROS package."""
    _, scheme, rest = name.rpartition("://")
    package, _, inside = rest.partition("/")
    shares = map(Path, package_shares()) if scheme else ()
    found = [place / rest for place in (folder, *folder.parents[:3], *shares)]
    if scheme and package in around:
        found.append(around[package] / inside)
    for path in found:
        with suppress(OSError):  # such as a name that is too long
            if path.is_file() and path.suffix.lower() in MESH_KINDS:
                return path.resolve()
    return None


def add_missing_inertials(root: ET.Element, joint_names: Sequence[str]) -> tuple[str, ...]:
    """Add inertias that a URDF lacks; return the names of the arm's links that had none.

    URDFs for planning, such as those of ROS-Industrial, have none. PyBullet would assume 1 kg and
    1 kg m^2 for each link, even for frames such as `tool0`, which weigh nothing.
    """
    joints = {link_of(joint, "child"): joint for joint in root.findall("joint[@type]")}
    weighed = []
    for link in root.findall("link"):
        name = link.get("name", "")
        if name not in joints or all(
            link.find(f"inertial/{part}") is not None for part in ("mass", "inertia")
        ):
            continue
        for broken in link.findall("inertial"):
            link.remove(broken)
        mass, moment = 0.0, 0.0
        if joints[name].get("type") != "fixed":
            of_arm = joints[name].get("name") in joint_names
            mass, moment = (DEFAULT_MASS_KG, DEFAULT_INERTIA) if of_arm else JAW
            weighed += [name] if of_arm else []
        add_inertial(link, mass, (0.0, 0.0, 0.0), np.full(3, moment))
    return tuple(weighed)


def add_rotors(root: ET.Element, rotors: Mapping[str, float]) -> None:
    """Add the inertia of joints' motors behind their gears [kg m^2] to the links they move.

    Rotors are massless discs with J about the joint's axis and J/2 across it: no body has inertia
    about one axis only, and PyBullet sets such an inertia to zero. Other joints of the chain feel
    the rotor if their axes line up, by at most J; a real gear of 1:100 passes on a hundredth.
    """
    links = {link.get("name"): link for link in root.findall("link")}
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for name, rotor in rotors.items():
        joint = joints[name]
        if joint.get("type") == "prismatic":
            continue
        axis, link = joint.find("axis"), links[link_of(joint, "child")]
        direction = _numbers("1 0 0" if axis is None else axis.get("xyz", "1 0 0"))
        _add_rotor(link, direction / np.linalg.norm(direction), float(rotor))


def _add_rotor(link: ET.Element, axis: Floats, rotor: float) -> None:
    """Add a rotor to a link's inertia, which is given in the axes of its inertial frame."""
    origin, inertia = link.find("inertial/origin"), link.find("inertial/inertia")
    assert inertia is not None  # `add_missing_inertials`
    rpy = _numbers("0 0 0" if origin is None else origin.get("rpy", "0 0 0"))
    axis = Rotation.from_euler("xyz", rpy).inv().apply(axis)
    added = 0.5 * rotor * (np.eye(3) + np.outer(axis, axis))
    for i, j in combinations_with_replacement(range(3), 2):
        key = "i" + "xyz"[i] + "xyz"[j]
        inertia.set(key, repr(float(inertia.get(key, "0")) + float(added[i, j])))


def add_world(root: ET.Element, base_position_m: tuple[float, float, float]) -> None:
    """Make `world` the root, for viewers; meshes become URIs, and a raised base gets a block."""
    links, joints = root.findall("link"), root.findall("joint[@type]")
    children = {link_of(joint, "child") for joint in joints}
    base = next(name for name in (link.get("name", "") for link in links) if name not in children)
    if base != WORLD:
        root.insert(0, ET.Element("link", name=WORLD))
        joints.append(add_joint(root, "world_to_base", "fixed", WORLD, base, (0.0, 0.0, 0.0)))
    for joint in joints:
        if link_of(joint, "parent") == WORLD:
            origin = joint.find("origin")
            origin = ET.SubElement(joint, "origin") if origin is None else origin
            moved = _numbers(origin.get("xyz", "0 0 0")) + base_position_m
            origin.set("xyz", " ".join(map(repr, moved.tolist())))
    for mesh in root.iterfind("link//mesh"):
        mesh.set("filename", Path(mesh.get("filename", "")).as_uri())
    if base_position_m[2] > 0.0:
        world = next(link for link in root.findall("link") if link.get("name") == WORLD)
        world.append(_block(*base_position_m))


def _block(x: float, y: float, height: float) -> ET.Element:
    visual = ET.Element("visual")
    ET.SubElement(visual, "origin", xyz=f"{x} {y} {0.5 * height}")
    size = f"0.2 0.2 {height}"  # wider than a small arm's foot
    ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=size)
    ET.SubElement(ET.SubElement(visual, "material", name="block"), "color", rgba="0.4 0.44 0.48 1")
    return visual


def _numbers(text: str) -> Floats:
    return np.array([float(number) for number in text.split()])

# SPDX-License-Identifier: Apache-2.0
"""Read and check the XML of a URDF: a tree of links and joints with finite numbers."""

import os
import re
import subprocess
import sys
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.errors import ArgumentError, as_path, optional, printable
from intent_recognition.kinematics.packages import as_installed, packages_around
from intent_recognition.untrusted import LARGEST, MOST_TEXT, UntrustedError, load_xml, read_text

MOST_JOINTS = 150
"""Most moving joints of a URDF. pinocchio was measured to take 3 MB for 30 joints, 70 MB for 100
and 1.7 GB for 300. A humanoid with two hands has 80."""
ASSUMED = "assumed"
"""Attribute that `parse_urdf` gives to joints for which it assumes a limit."""
LINK = "link "
"""Prefix of link names in a pinocchio model."""
DEFAULT_SPEED = {"revolute": 1.0, "continuous": 1.0, "prismatic": 0.1}
"""Speed limit of a joint whose URDF has none above 0 [rad/s, m/s], below those of common arms and
lifts, so that a plan is slow rather than impossible."""
DEFAULT_EFFORT = {"revolute": 50.0, "continuous": 50.0, "prismatic": 500.0}
"""Effort limit of a joint whose URDF has none above 0 [Nm, N], as of the middle joints of arms."""
BEFORE_XML = "\ufeff \r\n\t"
"""Characters that may precede XML in a file but that parsers refuse."""
XACRO = "{http://www.ros.org/wiki/xacro}"
_SIX = dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1)
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "mass": {"value": 1},
    "inertia": _SIX,
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}
"""Numeric attributes of the elements of links and joints, with the count of numbers in each."""


def read_urdf(source: str | Path) -> str:
    """The text of a URDF that is given as text or as a path; a `.xacro` file is expanded.

    A xacro file finds packages that are installed, or whose source is beside its own package. Only
    expand files that you trust: xacro evaluates expressions and includes other files.

    Raises:
        ArgumentError: the file cannot be read.
    """
    if isinstance(source, str) and (text := source.lstrip(BEFORE_XML)).startswith("<"):
        return text
    path = as_path("robot", source)
    if path.suffix.lower() == ".xacro":
        return _expanded(path)
    try:
        text = read_text(path, 10 * MOST_TEXT).lstrip(BEFORE_XML)
        if not text.startswith("<"):
            raise UntrustedError("another kind of file")
        return text
    except (OSError, ValueError) as error:
        cure = "Give the path of a URDF, or its text."
        got = error if isinstance(error, OSError) else f"{source}: {error}"
        raise ArgumentError.about("robot", "a URDF", got, cure) from error


def _expanded(path: Path) -> str:
    """Expand a xacro file with its default arguments."""
    optional("xacro")
    command = [sys.executable, "-c", "import xacro; xacro.main()", "-q", str(path.resolve())]
    packages = packages_around(path.resolve().parent)
    with as_installed(packages) as prefixes:
        environment = {**os.environ, "AMENT_PREFIX_PATH": prefixes}
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode:
        cure = "Expand it yourself, with its arguments: xacro FILE name:=value > robot.urdf."
        got = printable(" ".join(done.stderr.split()))
        if missing := re.search(r"package '([^']+)' not found", got):
            cure = "Source the workspace that has it, or put its source beside the file's package."
            got = f"one that finds the package {missing[1]}, which is nowhere"
        raise ArgumentError.about("robot", "a xacro file", got, cure)
    text, links = done.stdout, Path(prefixes.rpartition(os.pathsep)[2], "share")
    for name, folder in packages.items():  # where `file://$(find NAME)` leads
        text = text.replace(f"{links / name}/", f"{folder.resolve()}/")
    return text


def parse_xml(text: str) -> ET.Element:
    """Parse the text of a URDF and return its root, without checking the content.

    A default namespace is left out of the names of elements.

    Raises:
        ArgumentError: the text is no XML, or larger or deeper than a URDF.
    """
    try:
        root = load_xml(text)
    except UntrustedError as error:
        cure = "Expand a xacro file first: xacro FILE > robot.urdf."
        raise ArgumentError.about("robot", "a URDF", error, cure) from error
    namespace = root.tag[: root.tag.find("}") + 1]
    for element in root.iter():
        element.tag = element.tag.removeprefix(namespace)
    return root


def parse_urdf(source: str | Path) -> ET.Element:
    """Parse a URDF and check that its links and joints form trees with finite numbers.

    Speed and effort limits that are missing, 0 or below are set to `DEFAULT_SPEED` and
    `DEFAULT_EFFORT`; such joints get the attribute `ASSUMED`.

    Raises:
        ArgumentError: the file cannot be read or is no URDF; the message says what is wrong.
    """
    root = parse_xml(read_urdf(source))
    links, joints = root.findall("link"), root.findall("joint")
    if any(element.tag.startswith(XACRO) for element in root.iter()):
        cure = "Name it FILE.xacro, or expand it: xacro FILE > robot.urdf."
        raise ArgumentError.about("robot", "a URDF", "a xacro file that is not expanded", cure)
    if root.tag != "robot" or not links:
        got = f"<{root.tag}>" if root.tag != "robot" else "no link"
        raise ArgumentError.about("robot", "a URDF: <robot> with links", got, "Check the file.")
    joints = [joint for joint in joints if joint.get("type")]
    moving = sum(joint.get("type") != "fixed" for joint in joints)
    if len(links) > 1000:  # a humanoid with two hands has a hundred
        _refuse("robot", "at most 1000 links", len(links))
    if moving > MOST_JOINTS:
        _refuse("robot", f"at most {MOST_JOINTS} joints that move", moving)
    names = _names("link", links)
    _names("joint", joints)
    _check_tree(names, joints)
    for part in (*links, *joints):
        for element in part.iter():
            for attribute, count in _NUMBERS.get(element.tag, {}).items():
                _check_numbers(part, element, attribute, count)
    for joint in joints:
        _complete(joint)
    return root


def link_of(joint: ET.Element, end: str) -> str:
    """Name of the link at one end of a joint, `parent` or `child`."""
    element = joint.find(end)
    name = None if element is None else element.get("link")
    if name is None:
        raise ArgumentError.about(joint.get("name", "joint"), f"a {end} link", "none", "Add it.")
    return name


def separate_names(root: ET.Element) -> str:
    """The text of a URDF whose link names begin with `LINK`, so that no joint has a link's name.

    pinocchio keeps both in one list, and cannot reduce a model in which two names are equal.
    """
    copy = deepcopy(root)
    for link in copy.findall("link"):
        link.set("name", LINK + link.get("name", ""))
    for joint in copy.findall("joint"):
        for end in (*joint.findall("parent"), *joint.findall("child")):
            end.set("link", LINK + end.get("link", ""))
    return ET.tostring(copy, encoding="unicode")


def _complete(joint: ET.Element) -> None:
    """Give a moving joint the speed and effort limits that it lacks."""
    kind, limit = joint.get("type", ""), joint.find("limit")
    if kind not in DEFAULT_SPEED:
        return
    limit = ET.SubElement(joint, "limit") if limit is None else limit
    for attribute, default in (("velocity", DEFAULT_SPEED), ("effort", DEFAULT_EFFORT)):
        with suppress(ValueError):  # invalid numbers are refused where they are needed
            if float(limit.get(attribute, "0")) <= 0.0:
                limit.set(attribute, repr(default[kind]))
                joint.set(ASSUMED, attribute)


def _names(kind: str, elements: list[ET.Element]) -> set[str]:
    found: set[str] = set()
    for element in elements:
        name = element.get("name", "")
        if not name or name in found:
            _refuse("robot", f"a name of its own for each {kind}", name or "none")
        found.add(name)
    return found


def _check_tree(links: set[str], joints: list[ET.Element]) -> None:
    """Check that each joint connects two known links, and that there are no cycles."""
    above: dict[str, str] = {}
    for joint in joints:
        parent, child = link_of(joint, "parent"), link_of(joint, "child")
        for end in (parent, child):
            if end not in links:
                _refuse(joint.get("name", "joint"), "links of the URDF as its ends", end)
        if child in above:
            _refuse("robot", "one joint above each link", f"two above {child}")
        above[child] = parent
    checked: set[str] = set()
    for link in links:
        way: set[str] = set()
        while link in above and link not in checked:
            if link in way:
                _refuse("robot", "a tree of links", f"a circle through {link}")
            way.add(link)
            link = above[link]
        checked |= way


def _check_numbers(part: ET.Element, element: ET.Element, attribute: str, count: int) -> None:
    text = element.get(attribute, "0 0 0" if element.tag == "axis" else None)
    if text is None:
        return
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    expected = f"{attribute} of its {element.tag}: {count} number{'s' * (count > 1)}"
    expected += f" up to {LARGEST:g}"
    if values.shape != (count,) or not np.all(np.abs(values) <= LARGEST):
        _refuse(part.get("name", ""), expected, text)
    if element.tag == "mass" and values[0] < 0.0:
        _refuse(part.get("name", ""), f"{expected}, not below 0", text)
    turns = element.tag == "axis" and part.get("type") != "fixed"
    if turns and np.abs(values).max() < 1e-6:
        _refuse(part.get("name", ""), f"{expected}, not all 0", text)


def _refuse(argument: str, expected: str, got: object) -> NoReturn:
    raise ArgumentError.about(argument, expected, got, "Check it with check_urdf.")

# SPDX-License-Identifier: Apache-2.0
"""Read a chain of joints from a URDF: names, limits and mimic joints, without meshes.

The text is parsed with the standard library. The URDF handed on for a model has no visual and
collision shapes, so that no mesh file is needed.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from intent_recognition.errors import ArgumentError, first_of
from intent_recognition.kinematics.limits import PRISMATIC_SCALE_M, JointLimits
from intent_recognition.kinematics.urdf_tip import MOVING, default_tip
from intent_recognition.kinematics.urdf_tree import ASSUMED, link_of, parse_urdf, separate_names
from intent_recognition.signals import OFTEN_TAKEN, length_misfit, taken_for
from intent_recognition.untrusted import LARGEST

UNLIMITED_RAD = LARGEST
"""Position limit given to continuous joints [rad], which have none."""
LIKELY_DEGREES = 12.0 * np.pi, 720.0
"""Limits of a revolute joint between these values [rad] are taken to be in degrees: cables do not
allow six turns, and two turns are common."""


class Mimic(NamedTuple):
    """A joint that follows another: value = multiplier * master + offset."""

    joint: str
    master: str
    multiplier: float
    offset: float


class UrdfChain(NamedTuple):
    """The chain of joints between two links of a URDF."""

    # the URDF for pinocchio: no shapes, continuous joints with limits out of reach, and link names
    # changed by `separate_names`
    xml: str
    base: str
    tip: str
    # independent joints that move the tip, from the base on, then those beyond it if asked for
    names: tuple[str, ...]
    continuous: tuple[bool, ...]  # whether each of these joints has no position limits
    limits: JointLimits
    mimics: tuple[Mimic, ...]  # mimic joints of the whole URDF
    # joints of the chain that got a default speed or effort limit
    assumed: tuple[str, ...]


class Ranges(NamedTuple):
    """Bounds of a URDF's motion."""

    # lower and upper limit [rad, m] by name of a revolute or prismatic joint
    joints: dict[str, tuple[float, float]]
    reach_m: float  # upper bound of any link's distance from the root


@lru_cache(maxsize=8)
def read_ranges(source: str | Path) -> Ranges:
    """Read the ranges of a URDF's joints, leaving out joints without a range.

    Raises:
        ArgumentError: the source is no URDF, or a limit is not a finite number.
    """
    ranges, reach_m = {}, 0.0
    for joint in parse_urdf(source).findall("joint"):
        reach_m += _length_m(joint)
        limit = joint.find("limit")
        if joint.get("type") not in ("revolute", "prismatic") or limit is None:
            continue
        lower, upper = (_number(joint, limit, end, 0.0) for end in ("lower", "upper"))
        if lower < upper:
            ranges[joint.get("name", "")] = (lower, upper)
        reach_m += max(abs(lower), abs(upper)) if joint.get("type") == "prismatic" else 0.0
    return Ranges(ranges, reach_m)


def read_chain(
    source: str | Path,
    base: str | None,
    tip: str | None,
    acceleration_rad_s2: float,
    beyond: bool = False,
) -> UrdfChain:
    """Read the chain between two links, and optionally beyond its tip; see `Arm.from_urdf`.

    Raises:
        ArgumentError: the source is no URDF, a link is unknown, no chain joins the links, a joint
            has no limits, or units are wrong.
    """
    root = parse_urdf(source)
    joints = [joint for joint in root.findall("joint") if joint.get("type")]
    above = {link_of(joint, "child"): joint for joint in joints}
    links = [link.get("name", "") for link in root.findall("link")]
    for argument, name in (("base", base), ("tip", tip)):
        if name is not None and name not in links:
            expected = f"a link of {first_of(links, 12)}"
            raise ArgumentError.about(argument, expected, name, "Name one.")
    if base is None:
        base, *others = [link for link in links if link not in above] or [""]
        if others or not base:
            roots = first_of([base, *others], 12)
            raise ArgumentError.about("base", "one root link", roots, "Name the base.")
    mimics = {mimic.joint: mimic for mimic in mimics_of(joints)}
    by_name = {joint.get("name", ""): joint for joint in joints}
    masters = {m.joint: m.master for m in mimics.values() if m.master in {*by_name} - {m.joint}}
    if tip is None:
        tip = default_tip(base, joints, masters)
    way = _way(base, tip, above)
    if beyond:
        moving = [joint.get("name", "") for joint in way if joint.get("type") in MOVING]
        way += _way(tip, default_tip(tip, joints, masters, moving), above)
    names = []
    for joint in way:
        kind, name = joint.get("type", ""), joint.get("name", "")
        if kind not in (*MOVING, "fixed"):
            expected = "revolute, continuous, prismatic or fixed joints"
            raise ArgumentError.about(name, expected, kind, "Choose base and tip beyond it.")
        master = mimics[name].master if name in mimics else name
        if kind in MOVING and master not in names:
            names.append(master)
    if not names:
        cure = "Name another tip, or the URDF of an arm."
        raise ArgumentError.about("tip", f"a link beyond a moving joint, from {base} on", tip, cure)
    missing = [name for name in names if name not in by_name]
    if missing:
        raise ArgumentError.about("mimic", "a joint of the URDF", missing[0], "Correct it.")
    _check_lengths(way, tip)
    moved = [by_name[name] for name in names]
    limits = _limits(moved, acceleration_rad_s2)
    limits = _with_mimics(limits, names, by_name, [mimics[m] for m in _names(way) if m in mimics])
    continuous = tuple(joint.get("type") == "continuous" for joint in moved)
    assumed = tuple(name for name in names if by_name[name].get(ASSUMED))
    return UrdfChain(
        _bare(root), base, tip, tuple(names), continuous, limits, tuple(mimics.values()), assumed
    )


def _length_m(joint: ET.Element) -> float:
    """Distance of a joint from the parent link's origin."""
    origin = joint.find("origin")
    xyz = None if origin is None else origin.get("xyz")
    return float(np.linalg.norm(np.array((xyz or "0").split(), float)))


def _check_lengths(way: list[ET.Element], tip: str) -> None:
    """Refuse an arm whose length, from its first moving joint on, cannot be in metres."""
    first = next(k for k, joint in enumerate(way) if joint.get("type") in MOVING)
    length_m = sum(map(_length_m, way[first + 1 :]))
    got = f"{length_m:.4g} m from joint {_names(way)[first]} to {tip}"
    if (found := length_misfit(length_m, got, "write")) is not None:
        raise ArgumentError.about("robot", "an arm in metres", got, found.likely)


def _names(joints: list[ET.Element]) -> list[str]:
    return [joint.get("name", "") for joint in joints]


def _way(base: str, tip: str, above: Mapping[str, ET.Element]) -> list[ET.Element]:
    way: list[ET.Element] = []
    link = tip
    while link != base:
        if link not in above or len(way) > len(above):
            cure = "Name a tip below the base."
            raise ArgumentError.about("tip", f"a link below {base}", tip, cure)
        way.insert(0, above[link])
        link = link_of(above[link], "parent")
    return way


def mimics_of(joints: list[ET.Element]) -> tuple[Mimic, ...]:
    """Mimic joints of a URDF; a mimic of a mimic joint is resolved to the latter's master."""
    mimics: dict[str, Mimic] = {}
    for joint in joints:
        if (found := joint.find("mimic")) is not None:
            name, master = joint.get("name", ""), found.get("joint", "")
            multiplier = _number(joint, found, "multiplier", 1.0)
            offset = _number(joint, found, "offset", 0.0)
            mimics[name] = Mimic(name, master, multiplier, offset)
    for name in mimics:
        passed = {name}
        while (own := mimics[name]).master in mimics.keys() - passed:
            passed.add(own.master)
            above = mimics[own.master]
            factor, shift = own.multiplier * above.multiplier, own.multiplier * above.offset
            mimics[name] = Mimic(name, above.master, factor, own.offset + shift)
    return tuple(mimics.values())


def _number(
    joint: ET.Element, element: ET.Element | None, attribute: str, default: float | None = None
) -> float:
    text = None if element is None else element.get(attribute)
    if text is None and default is not None:
        return default
    try:
        value = float(text) if text is not None else np.nan
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        name = joint.get("name", "joint")
        limit = '<limit lower="" upper="" velocity="" effort=""/>'
        cure = f"Write it into the URDF: {limit} of {name}."
        raise ArgumentError.about(name, f"a finite {attribute}", text or "none", cure)
    return value


def _limits(joints: list[ET.Element], acceleration_rad_s2: float) -> JointLimits:
    values: dict[str, list[float]] = {name: [] for name in ("lower", "upper", "velocity", "effort")}
    for joint in joints:
        limit = joint.find("limit")
        for name, bound in (("lower", -UNLIMITED_RAD), ("upper", UNLIMITED_RAD)):
            kind = joint.get("type")
            value = bound if kind == "continuous" else _number(joint, limit, name)
            if kind == "revolute" and LIKELY_DEGREES[0] < abs(value) <= LIKELY_DEGREES[1]:
                cure = taken_for("rad", OFTEN_TAKEN["rad"], "write")
                got = f"{value:g}"
                raise ArgumentError.about(_names([joint])[0], f"{name} in radians", got, cure)
            values[name].append(value)
        if values["lower"][-1] >= values["upper"][-1]:
            cure = "Write its range into the URDF, or make it fixed."
            expected = f"an upper limit above the lower one, {values['lower'][-1]:g}"
            raise ArgumentError.about(_names([joint])[0], expected, values["upper"][-1], cure)
        for name in ("velocity", "effort"):
            values[name].append(_number(joint, limit, name))
    lower, upper, velocity, effort = (np.array(column) for column in values.values())
    prismatic = np.array([joint.get("type") == "prismatic" for joint in joints])
    scale = np.where(prismatic, PRISMATIC_SCALE_M, 1.0)
    acceleration = np.full(len(joints), acceleration_rad_s2)
    return JointLimits(lower, upper, velocity, acceleration, effort, scale)


def _with_mimics(
    limits: JointLimits, names: list[str], by_name: Mapping[str, ET.Element], mimics: list[Mimic]
) -> JointLimits:
    """Narrow the limits so that mimic joints stay inside theirs, too."""
    lower, upper, velocity = limits.lower.copy(), limits.upper.copy(), limits.velocity.copy()
    for mimic in mimics:
        joint, k = by_name[mimic.joint], names.index(mimic.master)
        limit = joint.find("limit")
        fastest = _number(joint, limit, "velocity", 0.0)
        if fastest > 0.0 and mimic.multiplier != 0.0:
            velocity[k] = min(velocity[k], fastest / abs(mimic.multiplier))
        if joint.get("type") != "continuous" and mimic.multiplier != 0.0:
            ends = [_number(joint, limit, end) for end in ("lower", "upper")]
            ends = sorted((end - mimic.offset) / mimic.multiplier for end in ends)
            lower[k], upper[k] = max(lower[k], ends[0]), min(upper[k], ends[1])
    return replace(limits, lower=lower, upper=upper, velocity=velocity)


def _bare(root: ET.Element) -> str:
    bare = ET.Element("robot", name=root.get("name", "robot"))
    for link in root.findall("link"):
        element = ET.SubElement(bare, "link", name=link.get("name", ""))
        element.extend(link.findall("inertial"))
    for joint in root.findall("joint"):
        if joint.get("type") != "continuous":
            bare.append(joint)
            continue
        turned = ET.SubElement(bare, "joint", name=joint.get("name", ""), type="revolute")
        turned.extend(child for child in joint if child.tag != "limit")
        bound = repr(UNLIMITED_RAD)
        ET.SubElement(turned, "limit", lower=f"-{bound}", upper=bound, velocity=bound, effort=bound)
    return separate_names(bare)

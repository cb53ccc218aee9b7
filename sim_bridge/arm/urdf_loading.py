# SPDX-License-Identifier: Apache-2.0
"""Load a URDF text into a PyBullet world, with its joints free for torque control."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pybullet_data

from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import check_meshes, link_of, parse_xml
from sim_bridge.physics import BulletClient, pybullet

MOST_LINKS = 128
"""Most links whose states PyBullet reports."""
_TRY = """
import sys, pybullet
pybullet.connect(pybullet.DIRECT)
pybullet.loadURDF(sys.argv[1], flags=int(sys.argv[2]))
"""


class Joint(NamedTuple):
    """A moving joint: its number, name and type in PyBullet, and its limits [rad or m]."""

    number: int
    name: str
    kind: int
    lower: float
    upper: float


def fixtures_of(urdf: str) -> frozenset[str]:
    """Links with a shape that stand still and carry no moving joint, such as a table.

    Raises:
        ArgumentError: the text is no XML.
    """
    root = parse_xml(urdf)
    ends = [
        (j.get("type"), link_of(j, "parent"), link_of(j, "child")) for j in root.findall("joint")
    ]
    moved = {child for kind, _, child in ends if kind != "fixed"}
    for _ in ends:
        moved |= {child for _, parent, child in ends if parent in moved}
    carriers = {parent for kind, parent, _ in ends if kind != "fixed"}
    shaped = {link.get("name", "") for link in root.findall("link[collision]")}
    return frozenset(shaped - moved - carriers)


def link_name(client: BulletClient, body: int, link: int) -> str:
    """Name of a link by its number; -1 is the root."""
    info = client.getBodyInfo(body)[0] if link < 0 else client.getJointInfo(body, link)[12]
    return str(info.decode())


def stop_at_fixtures(
    client: BulletClient, body: int, urdf: str, joints: Sequence[int]
) -> frozenset[int]:
    """Let a body collide with itself only at its fixtures; return the numbers of these links.

    Each of these joints moves a rigid part of the robot. A fixture does not stop a part that it
    overlaps in the present posture, such as a lift in its column, or an idle arm beside the legs.
    """
    names = fixtures_of(urdf)
    links = range(-1, client.getNumJoints(body)) if names else range(0)
    part = {-1: -1}  # the link whose joint moves it; -1 if it stands still
    for link in links[1:]:  # parents come first
        part[link] = link if link in joints else part[client.getJointInfo(body, link)[16]]
    fixtures = frozenset(link for link in links if link_name(client, body, link) in names)
    pairs = [(a, b) for a in fixtures for b in links if part[b] >= 0]
    overlap = {(a, part[b]) for a, b in pairs if client.getClosestPoints(body, body, 0.0, a, b)}
    for a in links:
        for b in links[a + 2 :]:
            client.setCollisionFilterPair(body, body, a, b, 0)
    for a, b in pairs:
        client.setCollisionFilterPair(body, body, a, b, int((a, part[b]) not in overlap))
    return fixtures


def load_urdf(client: BulletClient, urdf: str, base_position_m: tuple[float, float, float]) -> int:
    """Load a URDF text with a fixed base and its own inertias; return PyBullet's body id.

    Raises:
        ArgumentError: PyBullet cannot load it.
    """
    if (count := urdf.count("<link ")) > MOST_LINKS:
        cure = "Leave out links beside the arm, such as those of another hand."
        raise ArgumentError.about("robot", f"at most {MOST_LINKS} links", count, cure)
    flags = pybullet.URDF_USE_INERTIA_FROM_FILE
    if fixtures_of(urdf):
        flags |= pybullet.URDF_USE_SELF_COLLISION
    with TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(urdf.replace("><", ">\n<"), encoding="utf-8")  # Bullet cuts long lines
        _try_meshes(urdf, path, flags)
        try:
            return client.loadURDF(
                str(path), basePosition=base_position_m, useFixedBase=True, flags=flags
            )
        except pybullet.error as error:
            cure = "Check it with check_urdf, and that its meshes can be read."
            raise ArgumentError.about("robot", "a URDF", error, cure) from error


def _try_meshes(urdf: str, path: Path, flags: int) -> None:
    """Try meshes that are not PyBullet's own in another process: some broken ones crash it."""
    meshes = [
        mesh
        for mesh in parse_xml(urdf).iter("mesh")
        if not mesh.get("filename", "").startswith(pybullet_data.getDataPath())
    ]
    if not meshes:
        return
    check_meshes(meshes)
    command = [sys.executable, "-c", _TRY, str(path), str(flags)]
    try:
        code = subprocess.run(command, capture_output=True, timeout=60.0).returncode
        got = f"some that end it by signal {-code}" if code < 0 else ""
    except subprocess.TimeoutExpired:
        got = "some that it has not read within 60 s"
    if got:
        cure = "Export them again."
        raise ArgumentError.about("robot", "meshes that PyBullet can read", got, cure)


def free_joints(
    client: BulletClient, body: int, names: Sequence[str], tip: str
) -> tuple[list[int], int, list[Joint]]:
    """Switch off PyBullet's motors of the named joints, and all damping.

    Returns:
        Indices of these joints, index of the link `tip`, and all moving joints in PyBullet's order.
    """
    moving: list[Joint] = []
    hand = -1
    for index in range(client.getNumJoints(body)):
        info = client.getJointInfo(body, index)
        if info[2] != pybullet.JOINT_FIXED:
            moving.append(Joint(index, info[1].decode(), info[2], info[8], info[9]))
        if info[12].decode() == tip:
            hand = index
    by_name = {joint.name: joint.number for joint in moving}
    indices = [by_name[name] for name in names]
    client.setJointMotorControlArray(
        body, indices, pybullet.VELOCITY_CONTROL, forces=[0.0] * len(indices)
    )
    for index in range(-1, client.getNumJoints(body)):
        client.changeDynamics(body, index, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0)
    return indices, hand, moving


class HeldJoints:
    """Holds fingers open, and other joints near zero."""

    def __init__(self, client: BulletClient, body: int, joints: Sequence[Joint]) -> None:
        self._client, self._body, self._joints = client, body, joints
        self.names = tuple(joint.name for joint in joints)

    def positions(self) -> list[float]:
        """Positions of the joints [rad or m]."""
        numbers = [joint.number for joint in self._joints]
        states = self._client.getJointStates(self._body, numbers) if numbers else ()
        return [state[0] for state in states]

    def reset(self) -> None:
        """Put the joints at the positions where they are held."""
        for joint in self._joints:
            held = _held(joint)
            self._client.resetJointState(self._body, joint.number, held, 0.0)
            self._client.setJointMotorControl2(
                self._body, joint.number, pybullet.POSITION_CONTROL, targetPosition=held, force=20.0
            )


def _held(joint: Joint) -> float:
    wanted = np.inf if joint.kind == pybullet.JOINT_PRISMATIC else 0.0
    return min(max(wanted, joint.lower), joint.upper) if joint.lower < joint.upper else 0.0

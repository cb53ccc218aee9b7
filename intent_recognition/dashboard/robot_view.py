# SPDX-License-Identifier: Apache-2.0
"""The arm in the scene, from the URDF on `robot_description`."""

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser
import yourdfpy
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial
from viser.extras import ViserUrdf

from intent_recognition.array_types import Floats
from intent_recognition.dashboard.things_view import quaternions
from intent_recognition.errors import ArgumentError
from intent_recognition.kinematics import Chain, joint_poses, tip_poses
from intent_recognition.motion import is_hand
from intent_recognition.untrusted import LARGEST

ROOT = "/robot"
TURNING, SHIFTING = ("revolute", "continuous"), ("prismatic",)
MOST_JOINTS = 300
"""Largest number of joints in a description; a humanoid with two hands has 80."""


class RobotView:
    """The robot of one URDF.

    Args:
        server: server of the page.
        description: text of the URDF, limited to what yourdfpy supports (no capsules).
        hand_link: name of the hand's link; if it is empty or not in the URDF, the link with the
            most joints above it.

    Raises:
        Exception: any kind; yourdfpy, lxml and trimesh do not document what they raise.
    """

    def __init__(self, server: viser.ViserServer, description: str, hand_link: str = ""):
        self._urdf = load_urdf(greyed(description))
        self._view = _MovingUrdf(server, self._urdf, root_node_name=ROOT)
        self._joints = tuple(self._view.get_actuated_joint_names())
        self._chain = chain_to(self._urdf, hand_link)
        self._poses = chain_of(self._chain)
        self._shown: Floats | None = None

    def update(self, positions: Mapping[str, float]) -> None:
        """Move the arm; joints that are not in `positions` [rad] stay at zero."""
        q = np.array([positions.get(name, 0.0) for name in self._joints])
        if self._shown is None or np.any(np.abs(q - self._shown) > 1e-4):
            self._view.move(self._joints, q)
            self._shown = q

    def hand_pose(self) -> Floats | None:
        """Pose of the hand (4, 4) as drawn; None before the first update."""
        if self._shown is None:
            return None
        values = joint_values(self._chain, self._joints, self._shown[None])[0]
        return tip_poses(self._poses, values)

    def hand_path(self, joints: Sequence[str], positions: Floats) -> Floats:
        """Positions of the hand (T', 3) [m] along a trajectory (T, d) of joints [rad] or hand."""
        chosen = np.unique(np.linspace(0, len(positions) - 1, 32).round().astype(int))
        if is_hand(joints):
            return positions[chosen, :3]
        values = joint_values(self._chain, joints, positions[chosen])
        return tip_poses(self._poses, values)[:, :3, 3]


def load_urdf(description: str) -> yourdfpy.URDF:
    """Read a URDF that is small enough to be drawn.

    Raises:
        ArgumentError: the URDF has too many joints, or numbers that cannot be drawn.
        Exception: yourdfpy cannot read it.
    """
    expected, cure = f"at most {MOST_JOINTS} joints", "Publish a simpler description."
    count = description.count("<joint")
    if count > MOST_JOINTS:
        raise ArgumentError.about("robot_description", expected, count, cure)
    text = io.BytesIO(description.encode(errors="replace"))
    urdf = yourdfpy.URDF.load(text, filename_handler=_mesh_file)
    joints = tuple(urdf.joint_map.values())
    if not all(np.all(np.abs(part) < LARGEST) for part in chain_of(joints)):
        raise ArgumentError.about("robot_description", "finite numbers", "others", cure)
    for shape in urdf.scene.geometry.values():
        _paint(shape)
    return urdf


def _paint(shape: Any) -> None:
    """Give a plain shape a material: glTF draws shapes without one as black metal."""
    colours = getattr(shape.visual, "face_colors", None)
    if colours is not None and len(colours) and np.all(colours == colours[0]):
        blend = {"alphaMode": "BLEND"} if colours[0][3] < 255 else {}
        material = PBRMaterial(baseColorFactor=colours[0], metallicFactor=0.0, **blend)
        shape.visual = TextureVisuals(material=material)


def _mesh_file(fname: str) -> str:
    """Path of a mesh as yourdfpy resolves it; empty if it is missing or too large."""
    path = yourdfpy.urdf.filename_handler_magic(fname, dir="")
    return path if Path(path).is_file() and Path(path).stat().st_size <= 50_000_000 else ""


class _MovingUrdf(ViserUrdf):
    """A URDF in the scene that is updated 25 times a second and sends only the joints that move."""

    def __init__(self, server: viser.ViserServer, urdf: yourdfpy.URDF, **options: Any) -> None:
        super().__init__(server, urdf, **options)
        self._all = tuple(urdf.joint_map.values())
        self._local = chain_of(self._all)
        self.update_cfg(np.zeros(len(urdf.actuated_joint_names)))  # fixed joints, once

    def move(self, names: Sequence[str], positions: Floats) -> None:
        """Move the named joints to positions (d,) [rad or m]."""
        values = joint_values(self._all, names, positions[None])[0]
        poses = joint_poses(self._local, values)
        wxyz = quaternions(poses[:, :3, :3])
        for k, frame in enumerate(self._joint_frames):
            if self._all[k].type in TURNING:
                frame.wxyz = wxyz[k]
            elif self._all[k].type in SHIFTING:
                frame.position = poses[k, :3, 3]


def joint_values(
    chain: Sequence[yourdfpy.Joint], names: Sequence[str], positions: Floats
) -> Floats:
    """Values of a chain's joints (T, n), from those of named joints (T, d); zero if not named."""
    values = np.zeros((len(positions), len(chain)))
    for k, joint in enumerate(chain):
        copied = joint.mimic
        name = joint.name if copied is None else copied.joint
        if name in names:
            values[:, k] = positions[:, list(names).index(name)]
        if copied is not None:
            values[:, k] = (copied.multiplier or 1.0) * values[:, k] + (copied.offset or 0.0)
    return values


def chain_of(joints: Sequence[yourdfpy.Joint]) -> Chain:
    """Kinematics of a serial chain of URDF joints, as arrays."""
    none = np.zeros(3)
    origins = [np.eye(4) if joint.origin is None else joint.origin for joint in joints]
    turns = [joint.axis if joint.type in TURNING else none for joint in joints]
    shifts = [joint.axis if joint.type in SHIFTING else none for joint in joints]
    n = len(joints)  # may be 0
    return Chain(
        np.reshape(origins, (n, 4, 4)), np.reshape(turns, (n, 3)), np.reshape(shifts, (n, 3))
    )


def chain_to(urdf: yourdfpy.URDF, link: str = "") -> tuple[yourdfpy.Joint, ...]:
    """Joints from the base to a link; without such a link, the longest chain."""
    above = {joint.child: joint for joint in urdf.joint_map.values()}

    def chain(link: str) -> tuple[yourdfpy.Joint, ...]:
        return (*chain(above[link].parent), above[link]) if link in above else ()

    links = [link] if link in urdf.link_map else urdf.link_map
    return max(map(chain, links), key=len)


def greyed(description: str) -> str:
    """The URDF with all materials grey; strong colours become slightly lighter."""

    def grey(found: re.Match) -> str:
        try:
            red, green, blue, *rest = (float(number) for number in found[1].split())
        except ValueError:
            return found[0]
        bright = 0.3 * red + 0.59 * green + 0.11 * blue
        bright += 0.35 * (1.0 - bright) * (max(red, green, blue) - min(red, green, blue))
        return 'rgba="' + " ".join(f"{number:.3f}" for number in (*[bright] * 3, *rest)) + '"'

    return re.sub(r'rgba="([^"]*)"', grey, description)

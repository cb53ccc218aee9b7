# SPDX-License-Identifier: Apache-2.0
"""The arms that can be simulated: the LWR, those of PyBullet's data, and any URDF.

An arm other than the LWR gets what its URDF does not hold from its torque limits, in the
proportions of the LWR's values: stiffness, friction while guided, and the inertia of the motors
behind their gears, without which light wrists cannot be controlled at 1 kHz.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, nearest
from intent_recognition.kinematics import (
    DEFAULT_ACCELERATION_RAD_S2,
    DEFAULT_EFFORT,
    DEFAULT_SPEED,
    JOINT_NAMES,
    JointLimits,
    parse_urdf,
    read_chain,
)
from intent_recognition.share import share_path
from sim_bridge.arm.controllers import ControllerGains
from sim_bridge.arm.urdf import (
    DEFAULT_INERTIA,
    DEFAULT_MASS_KG,
    add_missing_inertials,
    add_rotors,
    add_world,
    find_meshes,
    hold_others,
    written,
)

LARGEST_TORQUE_NM = 100.0
"""Torque limit from which on stiffness and rotors do not grow [Nm]: URDFs often exaggerate it.
Convention: that of the LWR's middle joints."""
READY_POSITION: tuple[float, ...] = (0.0, -0.45, 0.0, 1.55, 0.0, -1.1415926535897931, 0.0)
"""The LWR's joint angles [rad] with the elbow up and the hand in front of the base, fingers down:
all limits are far away. Convention."""


@dataclass(frozen=True, eq=False)
class Robot:
    """An arm as the simulation needs it."""

    name: str
    urdf: str  # text with the paths of its meshes made absolute, as PyBullet reads it
    description: str  # the same for viewers, beginning at the link `world`
    tip: str  # link that is the hand
    joint_names: tuple[str, ...]
    limits: JointLimits
    ready: Floats  # posture to begin in (n,) [rad]
    # where the base stands in the world (3,)
    base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gains: ControllerGains | None = None  # of its controllers; None: from torque limits and inertia
    source: str = ""  # text of a URDF with the same joints; `find_robot` makes the same arm of it
    # joints whose URDF has no limit of speed or effort; they have the defaults
    assumed: tuple[str, ...] = ()
    weighed: tuple[str, ...] = ()  # likewise links without mass or inertia

    @property
    def n_joints(self) -> int:
        """Number of joints of the chain."""
        return len(self.joint_names)

    @property
    def note(self) -> str:
        """Which limits and inertias are assumed; "" for none."""
        notes = []
        if self.assumed:
            speed, effort = DEFAULT_SPEED["revolute"], DEFAULT_EFFORT["revolute"]
            notes.append(
                f"{', '.join(self.assumed)}: the URDF has no limit of speed or effort above 0;"
                f" {speed:g} rad/s and {effort:g} Nm are assumed (prismatic:"
                f" {DEFAULT_SPEED['prismatic']:g} m/s, {DEFAULT_EFFORT['prismatic']:g} N)"
            )
        if self.weighed:
            notes.append(
                f"{', '.join(self.weighed)}: the URDF has no mass or inertia;"
                f" {DEFAULT_MASS_KG:g} kg and {DEFAULT_INERTIA:g} kg m^2 are assumed"
            )
        return "\n".join(notes)


class Preset(NamedTuple):
    """An arm that needs no file of the user's: its file is of our share, or of PyBullet's data."""

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
    "lwr": Preset("config/robots/lwr.urdf", "lwr_hand", READY_POSITION),
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


def find_robot(
    robot: str, *, base: str = "", tip: str = "", base_position_m: Sequence[float] | None = None
) -> Robot:
    """An arm by its name, or from the path of a URDF or xacro file.

    Joints that neither move the hand nor hang on it, such as wheels, a head and another arm, are
    held at zero; so are those below `base`.

    The base is the root by default; the tip, the link that is the hand, and where the base stands
    in the world (3,) are the preset's, or what `Arm.from_urdf` takes.

    Raises:
        ArgumentError: neither, or the URDF cannot be used.
    """
    preset = PRESETS.get(robot)
    path = Path(robot) if preset is None else preset.path
    if not path.is_file():
        expected = f"one of {', '.join(NAMES)}, or the path of a URDF or xacro file"
        cure = nearest(robot, NAMES, "Check the path.")
        raise ArgumentError.about("robot", expected, f"{robot}, which is no file", cure)
    usual = preset or Preset("", "", ())
    place = usual.base_position_m if base_position_m is None else base_position_m
    if len(place) != 3 or not np.all(np.isfinite(place)):
        raise ArgumentError.about("base_position_m", "x, y, z", place, "In metres.")
    at = float(place[0]), float(place[1]), float(place[2])
    root = parse_urdf(path)
    find_meshes(root, path.resolve().parent)
    tip = tip or usual.tip
    chain = read_chain(written(root), base or None, tip or None, DEFAULT_ACCELERATION_RAD_S2)
    hold_others(root, chain.names)
    weighed = add_missing_inertials(root, chain.names)
    source = written(root)
    copies = [mimic.joint for mimic in chain.mimics if mimic.master in chain.names]
    if copies:
        cure = "Choose a tip before it."
        raise ArgumentError.about("robot", "a chain without mimic joints", copies[0], cure)
    middle = 0.5 * (chain.limits.lower + chain.limits.upper)
    ready = np.where(chain.continuous, 0.0, middle)
    if len(usual.ready) == len(chain.names):
        ready = np.array(usual.ready)
    if robot != "lwr":  # whose URDF has them
        torque = np.minimum(chain.limits.torque, LARGEST_TORQUE_NM)
        add_rotors(root, dict(zip(chain.names, 1.1e-3 * torque, strict=True)))
    simulated = written(root)
    add_world(root, at)
    return Robot(
        path.stem if preset is None else robot,
        simulated,
        written(root),
        chain.tip,
        chain.names,
        chain.limits,
        ready,
        at,
        ControllerGains() if chain.names == JOINT_NAMES else None,
        source,
        chain.assumed,
        weighed,
    )


def describe_robot(robot: str = "") -> str:
    """URDF for viewers of an arm, by name or path; the LWR's if it is empty."""
    return find_robot(robot or "lwr").description


def derived_gains(torque: Floats, inertia: Floats) -> ControllerGains:
    """Gains of an arm that is not the LWR, from torque limits (n,) [Nm].

    The inertia (n,) [kg m^2] is of each joint alone in the ready posture.
    """
    torque = np.minimum(torque, LARGEST_TORQUE_NM)
    stiffness = 1.2 * torque  # as the LWR's large joints
    return ControllerGains(
        stiffness=stiffness,
        damping=2.0 * 0.8 * np.sqrt(stiffness * inertia),  # ratio 0.8, each joint alone
        guide_damping=0.01 * torque,
        guide_friction=np.zeros(len(torque)),
        limit_stiffness=8.0 * torque,
        limit_damping=0.17 * torque,
    )

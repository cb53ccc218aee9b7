# SPDX-License-Identifier: Apache-2.0
"""The arms that can be simulated: the LWR, arms of PyBullet's data, and any URDF.

URDFs usually lack stiffness, friction while guided, and the inertia of motors behind their gears,
without which light wrists cannot be controlled at 1 kHz. For arms other than the LWR, they are
derived from the torque limits, in proportion to the LWR's values.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError, first_of, nearest
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
    MESH_KINDS,
    add_missing_inertials,
    add_rotors,
    add_world,
    find_meshes,
    hold_others,
    written,
)

LARGEST_TORQUE_NM = 100.0
"""Torque limit above which stiffness and rotor inertia do not grow [Nm], because URDFs often
exaggerate it; the limit of the LWR's middle joints."""
SLOW = 0.08
"""Speed limit of a joint [rad/s, m/s] below which a reach takes seconds, as of lifts."""
WITH_SLOW = "with_slow_joints"
"""Attribute of a URDF whose base was named, so that no joint beyond it is held."""
LEAST_JOINTS = 6
"""Fewest joints of an arm that needs no slow lift: it reaches any pose without."""
READY_POSITION: tuple[float, ...] = (0.0, -0.45, 0.0, 1.55, 0.0, -1.1415926535897931, 0.0)
"""The LWR's joint angles [rad] with the elbow up and the hand in front of the base, fingers down,
far from all limits."""


@dataclass(frozen=True, eq=False)
class Robot:
    """An arm with all that its simulation needs."""

    name: str
    urdf: str  # URDF text for PyBullet, with absolute paths of meshes
    description: str  # URDF text for viewers, with the root link `world`
    tip: str  # link that is the hand
    joint_names: tuple[str, ...]
    limits: JointLimits
    ready: Floats  # posture to begin in (n,) [rad]
    # where the base stands in the world (3,)
    base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gains: ControllerGains | None = None  # controller gains; None derives them (`derived_gains`)
    source: str = ""  # URDF text from which `find_robot` makes the same arm
    # joints without a speed or effort limit in the URDF, which have the defaults
    assumed: tuple[str, ...] = ()
    weighed: tuple[str, ...] = ()  # links without mass or inertia in the URDF, with the defaults
    unseen: tuple[str, ...] = ()  # meshes that cannot be used, whose shapes are left out
    held: tuple[str, ...] = ()  # slow joints before the arm, such as a lift, held at zero

    @property
    def n_joints(self) -> int:
        """Number of joints of the chain."""
        return len(self.joint_names)

    @property
    def note(self) -> str:
        """Text that says what is assumed, left out or slow; "" if nothing is."""
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
        if self.limits.velocity.min() < SLOW:
            name = self.joint_names[int(self.limits.velocity.argmin())]
            notes.append(f"{name} is slow and delays the arm: --base LINK holds joints before LINK")
        if self.held:
            notes.append(
                f"{', '.join(self.held)}: slow, and held at zero; --base ROOT moves it, too"
            )
        if self.unseen:
            notes.append(
                f"{first_of(self.unseen, 1)}: left out, as no file of {', '.join(MESH_KINDS)} is"
                " found. Source the workspace with its package, or put it beside the URDF"
            )
        return "\n".join(notes)


class Preset(NamedTuple):
    """An arm whose URDF is in this package's share or in PyBullet's data."""

    file: str
    tip: str
    ready: tuple[float, ...]
    base_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def path(self) -> Path:
        """Path of the URDF."""
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
    # A short arm, which stands nearer to the worker, on a block.
    "xarm": Preset(
        "xarm/xarm6_robot.urdf", "link6", (0.0, -0.3, -0.9, 0.0, -0.3, 0.0), (0.12, 0.0, 0.05)
    ),
}
"""Arms by name."""
NAMES = tuple(PRESETS)


def find_robot(
    robot: str, *, base: str = "", tip: str = "", base_position_m: Sequence[float] | None = None
) -> Robot:
    """Find an arm by its name, or read it from the path of a URDF or xacro file.

    Joints that neither move the hand nor are carried by it, such as wheels, a head, another arm and
    joints between the root and `base`, are held at zero; so are those before an arm that are slower
    than `SLOW`, such as a lift, unless `base` is given.

    `base` is the root by default. `tip`, the link that is the hand, and the position of the base in
    the world (3,) default to the preset's, for a file to the tip of `Arm.from_urdf` and the origin.

    Raises:
        ArgumentError: `robot` is neither a name nor a file, or the URDF cannot be used.
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
    unseen = find_meshes(root, path.resolve().parent)
    tip = tip or usual.tip
    chain = read_chain(written(root), base or None, tip or None, DEFAULT_ACCELERATION_RAD_S2)
    if base:
        root.set(WITH_SLOW, "true")
    n_slow = 0 if root.get(WITH_SLOW) else int(np.argmin(chain.limits.velocity < SLOW))
    held = chain.names[:n_slow] if len(chain.names) - n_slow >= LEAST_JOINTS else ()
    hold_others(root, chain.names[len(held) :])
    if held:
        chain = read_chain(written(root), None, chain.tip, DEFAULT_ACCELERATION_RAD_S2)
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
    if robot != "lwr":  # the LWR's URDF includes rotors
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
        unseen,
        held,
    )


def describe_robot(robot: str = "") -> str:
    """URDF for viewers of an arm, given by name or path; the LWR's if this is empty."""
    return find_robot(robot or "lwr").description


def derived_gains(torque: Floats, inertia: Floats) -> ControllerGains:
    """Derive gains of an arm other than the LWR from its torque limits (n,) [Nm].

    `inertia` (n,) [kg m^2] is that of each joint alone in the initial posture.
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

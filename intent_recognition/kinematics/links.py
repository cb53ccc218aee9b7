# SPDX-License-Identifier: Apache-2.0
"""Positions and speeds of the joints of a chain, for many postures at once.

pinocchio computes the same for one posture at a time (Featherstone 2008, "Rigid Body Dynamics
Algorithms", Chapter 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.kinematics.urdf import Mimic
from intent_recognition.signals import homogeneous


class Links(NamedTuple):
    """A tree of joints, and a tip on one of them."""

    # index of the parent joint of each joint and of the tip (nv + 1,); -1 for the base
    parents: tuple[int, ...]
    # what a joint or the tip adds to the parent's frame (nv + 1, 3, 11): its place, its axis, and
    # the rotations I, K and K^2 by Rodrigues' formula, I + sin q K + (1 - cos q) K^2
    parts: Floats
    turns: Floats  # 1 for a revolute joint, 0 for a prismatic one (nv,)
    # largest motion of any point per unit of each joint, in any posture (nv,): the length of the
    # chain beyond a revolute joint, 1 for a prismatic one
    levers: Floats

    @classmethod
    def of(cls, model: Any, tip_frame: int, from_base: Any) -> "Links":
        """Read a pinocchio model, whose joints have one DOF each, with the index of its tip frame.

        `from_base` is the pose of the model's root in the frame of the points; None for identity.
        """
        placements = [model.jointPlacements[k].homogeneous for k in range(1, model.njoints)]
        placements.append(model.frames[tip_frame].placement.homogeneous)
        beyond = np.linalg.norm(np.array(placements)[:, :3, 3], axis=1)[::-1].cumsum()[::-1]
        tip = model.frames[tip_frame].parentJoint
        parents = tuple(int(k) - 1 for k in (*model.parents[1:], tip))
        if from_base is not None:
            root, pairs = from_base.homogeneous, zip(parents, placements, strict=True)
            placements = [root @ placement if k < 0 else placement for k, placement in pairs]
        axes, turns, levers, travel = [np.zeros(3)], [], [], 0.0
        for k in range(model.njoints - 1, 0, -1):
            joint = model.joints[k]
            data = joint.createData()
            joint.calc(data, np.zeros(1))
            slide, turn = np.split(np.ravel(data.S), 2)
            turns.append(float(np.any(turn)))
            axes.append(turn if turns[-1] else slide)
            levers.append(beyond[k] + travel if turns[-1] else 1.0)
            if not turns[-1]:
                row = joint.idx_v
                ends = model.lowerPositionLimit[row], model.upperPositionLimit[row]
                travel += float(np.abs(ends).max())
        parts = []
        for placement, axis in zip(placements, reversed(axes), strict=True):
            turn, K = placement[:3, :3], np.cross(axis, np.eye(3)).T
            own = [axis[:, None], np.eye(3), K, K @ K]
            parts.append(np.hstack([placement[:3, 3:], turn @ np.hstack(own)]))
        return cls(parents, np.array(parts), np.array(turns)[::-1], np.array(levers)[::-1])

    def moving_points(self, q: Floats, rates: Floats) -> tuple[Floats, Floats]:
        """Origins of the joints and of the tip, (T, nv + 1, 3) [m], and their speeds (T, nv + 1).

        Joint values and their rates are (T, nv) each.
        """
        sines, cosines = np.sin(q.T), np.cos(q.T)
        # vectors are (3, T), and rotations (3, 3, T) with their columns first: numpy is slow on
        # short rows
        still, turned = np.zeros((3, len(q))), [np.eye(3)[:, :, None] + np.zeros(len(q))]
        steps, alongs, spins = [], [], [still]
        for k, (parent, parts) in enumerate(zip(self.parents, self.parts, strict=True)):
            own = (parts.T @ turned[parent + 1].reshape(3, -1)).reshape(-1, *still.shape)
            step, along, turn, spin = own[0], own[1], own[2:5], spins[parent + 1]
            if k < len(self.turns):
                if self.turns[k]:
                    turn = turn + sines[k] * own[5:8] + (1.0 - cosines[k]) * own[8:]
                    spin, along = spin + along * rates[:, k], still
                else:
                    step, along = step + along * q[:, k], along * rates[:, k]
            turned.append(turn)
            steps.append(step)
            alongs.append(along)
            spins.append(spin)
        moved = [np.stack([still, still])]  # places and velocities
        for parent, step, along in zip(self.parents, steps, alongs, strict=True):
            (a0, a1, a2), (b0, b1, b2) = spins[parent + 1], step
            swept = np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
            moved.append(moved[parent + 1] + np.stack([step, swept + along]))
        points, velocities = np.array(moved[1:]).transpose(1, 3, 0, 2)
        return points, np.linalg.norm(velocities, axis=2)


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """A model whose configuration (nv,) is driven by n joints: drive @ q + offset.

    All other joints of the full model are locked at zero. `geometry` holds the shapes, if any.
    `direct` says that the configuration is the joint vector itself.
    """

    model: Any
    geometry: Any
    drive: Floats
    offset: Floats
    direct: bool

    @classmethod
    def of(
        cls,
        pin: Any,
        full: Any,
        names: Sequence[str],
        mimics: Sequence[Mimic],
        geometry: Any = None,
    ) -> "ReducedModel":
        """Reduce a full model (and its geometry) to the joints `names`, in that order."""
        copies = {m.joint: m for m in mimics if m.master in names}
        kept = {*names, *copies}
        locked = [k for k, name in enumerate(full.names) if k and name not in kept]
        model = full
        if geometry is not None:
            model, geometry = pin.buildReducedModel(full, geometry, locked, np.zeros(full.nq))
        elif locked:
            model = pin.buildReducedModel(full, locked, np.zeros(full.nq))
        drive, offset = np.zeros((model.nv, len(names))), np.zeros(model.nv)
        for k, name in enumerate(model.names):
            if k == 0:
                continue
            row, copy = model.joints[k].idx_v, copies.get(name)
            master = name if copy is None else copy.master
            drive[row, names.index(master)] = 1.0 if copy is None else copy.multiplier
            offset[row] = 0.0 if copy is None else copy.offset
        return cls(model, geometry, drive, offset, np.array_equal(drive, np.eye(len(names))))

    def values(self, q: Floats) -> Floats:
        """The configuration (nv,) at a joint vector (n,)."""
        return q if self.direct else self.drive @ q + self.offset


class Chain(NamedTuple):
    """n joints, from the base on, including fixed ones.

    Joint values are in rad or m; those of fixed joints are ignored.
    """

    origins: Floats  # poses in the frame of the joint before, (n, 4, 4) [m]
    turns: Floats  # unit axes of revolute joints, zero for other joints, (n, 3)
    shifts: Floats  # unit axes of prismatic joints, zero for other joints, (n, 3)


def joint_poses(chain: Chain, values: ArrayLike) -> Floats:
    """Pose of each joint's frame in that of its parent, (..., n, 4, 4) [m], for values (..., n).

    The joints need not form a chain.
    """
    values = np.asarray(values, dtype=np.float64)[..., None]
    turns = Rotation.from_rotvec((values * chain.turns).reshape(-1, 3)).as_matrix()
    shifts = values * chain.shifts
    return chain.origins @ homogeneous(turns.reshape(*shifts.shape, 3), shifts)


def tip_poses(chain: Chain, values: Floats) -> Floats:
    """Poses of the last joint's frame in the base frame, (..., 4, 4) [m], for values (..., n)."""
    base = np.broadcast_to(np.eye(4), (*values.shape[:-1], 4, 4))
    return reduce(np.matmul, np.moveaxis(joint_poses(chain, values), -3, 0), base)

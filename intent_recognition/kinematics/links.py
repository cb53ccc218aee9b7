# SPDX-License-Identifier: Apache-2.0
"""Where the joints of a chain are and how fast, for many postures at once, and how far each moves.

As pinocchio computes them one by one (Featherstone 2008, "Rigid Body Dynamics Algorithms", Chapter
4), in arrays over the postures.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats


class Links(NamedTuple):
    """A tree of joints, and a tip on one of them.

    Attributes:
        parents: index of the joint that each is placed in, and the tip (nv + 1,); -1 for the base.
        placements: there (nv + 1, 4, 4).
        axes: of each joint in its own frame (nv, 3).
        turns: 1 where a joint turns, 0 where it slides (nv,).
        levers: how far a joint moves any point at most per its own unit (nv,): the length of the
            chain beyond it, whatever the posture.
    """

    parents: tuple[int, ...]
    placements: Floats
    axes: Floats
    turns: Floats
    levers: Floats

    @classmethod
    def of(cls, model: Any, tip_frame: int, from_base: Any) -> "Links":
        """Of a model of pinocchio, whose joints have one DOF each.

        Args:
            model: likewise.
            tip_frame: index of the tip's frame.
            from_base: placement of the model's root in the frame that points are wanted in, None
                where that is the same.
        """
        placements = [model.jointPlacements[k].homogeneous for k in range(1, model.njoints)]
        placements.append(model.frames[tip_frame].placement.homogeneous)
        beyond = np.linalg.norm(np.array(placements)[:, :3, 3], axis=1)[::-1].cumsum()[::-1]
        parents = (
            *(int(k) - 1 for k in model.parents[1:]),
            model.frames[tip_frame].parentJoint - 1,
        )
        if from_base is not None:
            root = from_base.homogeneous
            placements = [
                root @ p if k < 0 else p for k, p in zip(parents, placements, strict=True)
            ]
        axes, turns, levers, travel = [], [], [], 0.0
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
        order = slice(None, None, -1)
        return cls(
            parents, np.array(placements), *(np.array(a)[order] for a in (axes, turns, levers))
        )

    def moving_points(self, q: Floats, rates: Floats) -> tuple[Floats, Floats]:
        """Origins of the joints and of the tip, (T, nv + 1, 3) [m], and the fastest (T,) [m/s].

        Joints and their rates are (T, nv).
        """
        still = np.zeros((len(q), 3))
        frames = [(np.eye(3), still, still, still)]  # the base, then the joints
        for k, (parent, placement) in enumerate(zip(self.parents, self.placements, strict=True)):
            turn, place, spin, speed = frames[parent + 1]
            step = turn @ placement[:3, 3]
            place, speed = place + step, speed + np.cross(spin, step)
            turn = turn @ placement[:3, :3]
            if k < len(self.axes):
                along, rate = turn @ self.axes[k], rates[:, k, None]
                if self.turns[k]:
                    turn, spin = (
                        turn @ Rotation.from_rotvec(np.outer(q[:, k], self.axes[k])).as_matrix(),
                        spin + along * rate,
                    )
                else:
                    step = along * q[:, k, None]
                    place, speed = place + step, speed + along * rate + np.cross(spin, step)
            frames.append((turn, place, spin, speed))
        points = np.stack([place for _, place, _, _ in frames[1:]], axis=1)
        speeds = [np.linalg.norm(speed, axis=1) for *_, speed in frames[1:]]
        return points, np.max(speeds, axis=0)

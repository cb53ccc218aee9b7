# SPDX-License-Identifier: Apache-2.0
"""A model of pinocchio in which only named joints move, and those that copy them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from intent_recognition.array_types import Floats
from intent_recognition.kinematics.urdf import Mimic


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """The model, and how n joints drive its configuration: drive @ q + offset.

    Attributes:
        model: of pinocchio; every other joint stays at zero.
        geometry: shapes on it, if there were any.
        drive: (nv, n).
        offset: (nv,).
        direct: whether the configuration is the joint vector itself.
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
        """Of a whole model (and its geometry), with the joints `names`, in that order."""
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

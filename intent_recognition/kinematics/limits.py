# SPDX-License-Identifier: Apache-2.0
"""Joint limits of an arm as immutable arrays, and checks against them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import ArrayLike

from intent_recognition.array_types import Flags, Floats, settle
from intent_recognition.errors import ArgumentError, KinematicsError, ShapeError

POSITION_TOLERANCE_RAD = 1e-9
"""Tolerance of position limits [rad], for rounding. The planner and the simulated arm share it, so
that the arm accepts what the planner makes."""
PRISMATIC_SCALE_M = 0.1
"""Way of a prismatic joint that counts as a rad where differences are tolerated [m], as at the
speeds of a URDF that names none (`urdf_tree.DEFAULT_SPEED`)."""
RATE_TOLERANCE = 1e-6
"""Tolerance of velocity and acceleration limits, relative to the limit, for rounding."""


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Limits per joint as read-only arrays of shape (n_joints,).

    Positions range from `lower` to `upper` [rad]. The other limits are symmetric, in rad/s, rad/s^2
    and Nm. A prismatic joint has m and N in place of rad and Nm; what is tolerated of a joint is
    given in rad, and each rad is `tolerance_scale` of it: 1 rad, or `PRISMATIC_SCALE_M`.
    """

    lower: Floats
    upper: Floats
    velocity: Floats
    acceleration: Floats
    torque: Floats
    tolerance_scale: Floats = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        scale = np.broadcast_to(self.tolerance_scale, np.shape(self.lower))
        settle(self, tolerance_scale=scale)
        for name in (one.name for one in fields(self)):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.ndim != 1 or array.shape != np.shape(self.lower):
                cure = "Give one value per joint."
                raise ShapeError.about(name, f"shape {np.shape(self.lower)}", array.shape, cure)
            if not np.all(np.isfinite(array)):
                cure = "Use a large number for no limit."
                raise ArgumentError.about(name, "finite values", array, cure)
            if name not in ("lower", "upper") and np.any(array <= 0.0):
                cure = "Limits are symmetric magnitudes."
                raise ArgumentError.about(name, "positive values", array, cure)
            settle(self, **{name: array})
        if np.any(self.lower >= self.upper):
            cure = "Swap them, or make the joint fixed."
            raise ArgumentError.about("lower", f"values below upper {self.upper}", self.lower, cure)

    def largest(self, difference: Floats) -> Floats:
        """Largest of joint differences (..., n) in rad, by `tolerance_scale`; also of speeds."""
        return np.asarray(np.max(np.abs(difference) / self.tolerance_scale, axis=-1))

    def in_words(self, difference: Floats) -> str:
        """The largest of joint differences (n,), as "0.45 rad" or "0.03 m"."""
        worst = int(np.argmax(np.abs(difference) / self.tolerance_scale))
        return f"{abs(difference[worst]):.2f} {self.unit(worst)}"

    def unit(self, joint: int) -> str:
        """Name of the unit of a joint's position, "rad" or "m"."""
        return "rad" if self.tolerance_scale[joint] == 1.0 else "m"


def within_position_limits(
    q: ArrayLike, limits: JointLimits, tolerance_rad: float = POSITION_TOLERANCE_RAD
) -> Flags:
    """Return whether each joint vector of q (..., n) [rad] is inside; shape (...,), bool."""
    return np.all(position_violation(q, limits) <= tolerance_rad, axis=-1)


def position_violation(q: ArrayLike, limits: JointLimits) -> Floats:
    """Return by how much each joint of q (..., n) is outside [rad], 0 where it is inside."""
    q = np.asarray(q, dtype=np.float64)
    return np.maximum(np.maximum(limits.lower - q, q - limits.upper), 0.0)


def check_position(
    q: ArrayLike, limits: JointLimits, names: Sequence[str] | None = None, argument: str = "q"
) -> None:
    """Raise KinematicsError naming the worst joint of q (..., n) [rad] outside its limits."""
    excess = position_violation(q, limits)
    if not np.all(np.isfinite(excess)):
        raise KinematicsError.about(argument, "finite values", q, "Check where it came from.")
    if not np.any(excess > POSITION_TOLERANCE_RAD):
        return
    index = np.unravel_index(np.argmax(excess), excess.shape)
    joint = int(index[-1])
    name = names[joint] if names is not None else f"joint {joint}"
    unit = limits.unit(joint)
    expected = f"{name} in [{limits.lower[joint]:.4f}, {limits.upper[joint]:.4f}] {unit}"
    cure = "Clamp the position or choose another solution."
    raise KinematicsError.about(argument, expected, f"{np.asarray(q)[index]:.4f} {unit}", cure)

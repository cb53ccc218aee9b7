# SPDX-License-Identifier: Apache-2.0
"""Joint torque laws of the arm, as pure functions on arrays of shape (n,)."""

from dataclasses import dataclass, field, replace

import numpy as np

from intent_recognition.array_types import Floats, frozen
from intent_recognition.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class ControllerGains:
    """Gains of the joint controllers; arrays have shape (n,), defaults are the LWR's.

    Attributes:
        stiffness, damping: gains while following a reference [Nm/rad], [Nm s/rad].
        guide_damping: viscous friction in gravity compensation, so that the hand feels damped when
            guided and stops when released [Nm s/rad].
        guide_friction: dry friction in gravity compensation, smoothed by tanh [Nm].
        limit_margin_rad: distance from a joint limit at which the repulsive spring begins.
        limit_stiffness: stiffness of that spring [Nm/rad].
        limit_damping: damping inside the margin while moving outward [Nm s/rad].
    """

    stiffness: Floats = field(
        default_factory=lambda: frozen((200.0, 200.0, 120.0, 120.0, 60.0, 25.0, 15.0))
    )
    damping: Floats = field(default_factory=lambda: frozen((28.0, 28.0, 12.0, 12.0, 4.0, 2.0, 1.2)))
    guide_damping: Floats = field(
        default_factory=lambda: frozen((1.5, 1.5, 1.0, 1.0, 0.4, 0.2, 0.15))
    )
    guide_friction: Floats = field(default_factory=lambda: frozen(np.zeros(7)))
    limit_margin_rad: float = 0.06
    limit_stiffness: Floats = field(
        default_factory=lambda: frozen((1500.0, 1500.0, 900.0, 900.0, 500.0, 250.0, 200.0))
    )
    limit_damping: Floats = field(
        default_factory=lambda: frozen((30.0, 30.0, 15.0, 15.0, 6.0, 3.0, 2.0))
    )

    def scaled(self, stiffness_scale: float) -> "ControllerGains":
        """Return gains with the stiffness times a factor and the damping ratio kept."""
        if not (np.isfinite(stiffness_scale) and stiffness_scale > 0.0):
            cure = "1 is normal."
            raise ArgumentError.about("stiffness_scale", "a positive number", stiffness_scale, cure)
        return replace(
            self,
            stiffness=self.stiffness * stiffness_scale,
            damping=self.damping * np.sqrt(stiffness_scale),
        )


def impedance_torque(
    gains: ControllerGains, q: Floats, qd: Floats, q_reference: Floats, qd_reference: Floats
) -> Floats:
    """Return stiffness and damping toward the reference [Nm]; add inverse dynamics to it."""
    return gains.stiffness * (q_reference - q) + gains.damping * (qd_reference - qd)


def guiding_torque(gains: ControllerGains, qd: Floats) -> Floats:
    """Return the friction felt in gravity compensation [Nm]; full dry friction from 0.03 rad/s."""
    return -gains.guide_damping * qd - gains.guide_friction * np.tanh(qd / 0.03)


def limit_torque(
    gains: ControllerGains, free: tuple[Floats, Floats], q: Floats, qd: Floats
) -> Floats:
    """Return the torque (n,) [Nm] that pushes joints back between the two bounds of `free`."""
    lower, upper = free
    if (q >= lower).all() and (q <= upper).all():
        return np.zeros(q.shape)
    over, under = np.maximum(q - upper, 0.0), np.maximum(lower - q, 0.0)
    outward = ((over > 0.0) & (qd > 0.0)) | ((under > 0.0) & (qd < 0.0))
    return gains.limit_stiffness * (under - over) - gains.limit_damping * qd * outward

# SPDX-License-Identifier: Apache-2.0
"""A person's hand that takes and gives: mass, compliance, noise, and a grip that can slip.

The hand is a point mass that the arm, a spring and damper of limited strength, pulls to where the
person wants it. The grip on the object is a stiffer spring and damper, which slides when the load
exceeds what friction allows. This model does not know what the robot measures or decides.
"""

from dataclasses import dataclass

import numpy as np

from intent_recognition.array_types import Floats

HAND_KG = 0.6
"""Effective mass of hand and forearm [kg] (Dolan, Friedman and Nagurka 1993: 0.5 to 1.5)."""
DAMPING_RATIO = 0.7
"""Damping ratio of arm and grip."""
GRIP_N_M, GRIP_NM_RAD = 1200.0, 4.0
"""Stiffness of the finger pads in a grip [N/m], [Nm/rad], so that they yield by millimetres."""
LEAST_LIMIT_N, LIMIT_PER_LOAD = 3.0, 1.6
"""Largest load of a grip: a constant [N], plus this factor times the load that was felt (Johansson
and Westling 1984: people grip 1.4 to 2 times as hard as friction requires)."""
FEEL_S = 0.08
"""Time until the grip follows the load [s] (Johansson and Westling 1984: 60 to 100 ms)."""
NOISE_SHARE, TREMOR_N, NOISE_RAD_S = 0.04, 0.1, 60.0
"""Noise of the arm's force: as a share of the force (Jones, Hamilton and Wolpert 2002), at rest
[N], and its bandwidth [rad/s] (tremor has about 10 Hz)."""


@dataclass(frozen=True)
class Strength:
    """Stiffness and strength of a person's arm."""

    # stiffness at the hand (Mussa-Ivaldi, Hogan and Bizzi 1985: 100 to 400)
    stiffness_n_m: float = 200.0
    strongest_n: float = 14.0  # force at which the arm yields

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Strength":
        """Draw a person's arm."""
        return cls(rng.uniform(120.0, 300.0), rng.uniform(9.0, 14.0))


class CompliantHand:
    """A person's hand, stepped with the physics.

    Attributes:
        position_m, velocity_m_s: position and velocity of the hand (3,), world.
        target_m: position where the person wants the hand (3,), world.
        lift_n: upward force that the person adds on purpose, for the object's weight [N].
        force_n: force on the object in the last step (3,) [N].
        felt_n: load on the fingers as the person feels it, with a delay [N].
        holds: whether the hand holds the object.
    """

    def __init__(self, position_m: Floats, strength: Strength, rng: np.random.Generator) -> None:
        self._strength, self._rng = strength, rng
        self.position_m = np.array(position_m, dtype=np.float64)
        self.target_m, self.velocity_m_s = self.position_m.copy(), np.zeros(3)
        self.lift_n, self.force_n, self.holds = 0.0, np.zeros(3), False
        self._noise, self.felt_n, self._ready = np.zeros(3), 0.0, 1.0
        self._offset_m, self._slid_m = np.zeros(3), 0.0
        self._turn0 = np.array([0.0, 0.0, 0.0, 1.0])

    def grasp(self, point_m: Floats, turn: Floats, ready: float = 1.0) -> None:
        """Take hold of the object at a point (3,), in its orientation (quaternion xyzw).

        The grip begins with the share `ready` of `LEAST_LIMIT_N`, and grows to it within `FEEL_S`.
        """
        self.holds, self._slid_m, self._ready = True, 0.0, ready
        self._offset_m, self._turn0 = point_m - self.position_m, np.array(turn)

    def turn_to(self, turn: Floats) -> None:
        """Set the orientation in which the hand holds the object (quaternion xyzw)."""
        self._turn0 = np.array(turn)

    def let_go(self) -> None:
        """Open the hand."""
        self.holds, self.lift_n = False, 0.0

    def step(
        self,
        step_s: float,
        point_m: Floats,
        velocity_m_s: Floats,
        turn: Floats,
        spin_rad_s: Floats,
        mass_kg: float,
    ) -> tuple[Floats, Floats]:
        """Move the hand; return force (3,) [N] and torque (3,) [Nm] on the object.

        `point_m` and `velocity_m_s` (3,) are those of the held point, `turn` (4,), xyzw, and
        `spin_rad_s` (3,) those of the object. Its mass determines the damping of the grip.
        """
        self.force_n, torque = np.zeros(3), np.zeros(3)
        if self.holds:
            self.force_n = self._grip(step_s, point_m, velocity_m_s, mass_kg)
            torque = self._turning(turn, spin_rad_s)
        k = self._strength.stiffness_n_m
        pull = k * (self.target_m - self.position_m)
        size = float(np.linalg.norm(pull))
        pull *= min(1.0, self._strength.strongest_n / max(size, 1e-9))
        pull -= 2.0 * DAMPING_RATIO * np.sqrt(k * HAND_KG) * self.velocity_m_s
        pull[2] += self.lift_n
        level = TREMOR_N + NOISE_SHARE * float(np.linalg.norm(self.force_n))
        self._noise += -NOISE_RAD_S * step_s * self._noise + level * np.sqrt(
            2.0 * NOISE_RAD_S * step_s
        ) * self._rng.standard_normal(3)
        self.velocity_m_s += (pull + self._noise - self.force_n) / HAND_KG * step_s
        self.position_m += self.velocity_m_s * step_s
        self.felt_n += step_s / FEEL_S * (float(np.linalg.norm(self.force_n)) - self.felt_n)
        return self.force_n, torque

    def _grip(self, step_s: float, point_m: Floats, velocity_m_s: Floats, mass_kg: float) -> Floats:
        reduced_kg = mass_kg * HAND_KG / (mass_kg + HAND_KG)
        damping = 2.0 * DAMPING_RATIO * np.sqrt(GRIP_N_M * reduced_kg)
        stretch = self.position_m + self._offset_m - point_m
        force = GRIP_N_M * stretch + damping * (self.velocity_m_s - velocity_m_s)
        limit_n = self._ready * LEAST_LIMIT_N + LIMIT_PER_LOAD * self.felt_n
        self._ready = min(1.0, self._ready + step_s / FEEL_S)
        size = float(np.linalg.norm(force))
        if size > limit_n:  # it slides, and the pads hold as much as they can
            force *= limit_n / size
            held = (force - damping * (self.velocity_m_s - velocity_m_s)) / GRIP_N_M
            self._slid_m += float(np.linalg.norm(stretch - held))
            self._offset_m += held - stretch
            if self._slid_m > 0.04:  # the width of a few fingers
                self.let_go()
        return force

    def _turning(self, turn: Floats, spin_rad_s: Floats) -> Floats:
        """Torque that keeps the object in the orientation in which it was taken."""
        axis0, w0, axis, w = self._turn0[:3], self._turn0[3], turn[:3], turn[3]
        (a, b, c), (x, y, z) = axis, axis0
        cross = np.array([b * z - c * y, c * x - a * z, a * y - b * x])
        away = w0 * axis - w * axis0 - cross
        sign = 1.0 if w0 * w + axis0 @ axis >= 0.0 else -1.0
        torque = -2.0 * sign * GRIP_NM_RAD * away - 0.02 * spin_rad_s
        size = float(np.linalg.norm(torque))
        return torque * min(1.0, 1.0 / max(size, 1e-9))  # at most 1 Nm, as of a few fingers

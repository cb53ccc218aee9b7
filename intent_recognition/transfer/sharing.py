# SPDX-License-Identifier: Apache-2.0
"""Load sharing between two hands and the grip force it needs, as pure functions.

People who give an object reduce their grip force linearly with the load that they still carry
(Chan, Parker, Van der Loos and Croft 2012, "Grip forces and load forces in handovers: implications
for designing human-robot handover controllers", HRI; 2013, "A human-inspired object handover
controller", IJRR 32(8)). Forces act on the robot's hand and are in world axes, z up.
"""

import numpy as np

from intent_recognition.array_types import Floats

LIGHTEST_N = 3.0
"""Smallest weight that a person's share is computed with [N]: five standard deviations of the load
measured on the simulated LWR at rest."""
FIRM_N = 12.0
"""Grip on a weightless object [N]: with the friction of rubber on plastic (0.6) two fingers hold
14 N, the largest force allowed in a transfer."""
GRIP_PER_LOAD = 1.5
"""Grip force per load on the fingers. People use 1 to 2 (Chan et al. 2012, Section IV); with
friction 0.6 the minimum is 0.83."""
MOST_N = 70.0
"""Largest grip force [N], which the Franka Hand can hold continuously."""


def load_share(force_n: Floats, weight_n: float, toward: Floats | None) -> float:
    """Share of the load that the person has taken over, 0 to 1.

    Lifting and pulling toward the person increase it; pressing down and pushing decrease it.

    `force_n` (3,) is the force on the hand. `toward` is the horizontal unit vector to the person
    (3,); None: any horizontal direction.
    """
    lifted = float(force_n[2]) + weight_n
    pulled = np.hypot(force_n[0], force_n[1]) if toward is None else float(force_n @ toward)
    return float(np.clip((lifted + pulled) / max(weight_n, LIGHTEST_N), 0.0, 1.0))


def carrying_grip(load_n: float) -> float:
    """Grip force [N] of each finger that safely carries a load [N]."""
    return min(FIRM_N + GRIP_PER_LOAD * load_n, MOST_N)


def offering_grip(share: float, weight_n: float) -> float:
    """Grip force [N] when the person has taken over a share of the weight [N]; linear in it."""
    least_n = 2.0  # the fingers stay in contact
    return least_n + (carrying_grip(weight_n) - least_n) * (1.0 - share)


def away_from_base(person_m: Floats) -> Floats | None:
    """Direction `toward` for `load_share`, from the person's hand in the robot's base frame (3,).

    People take an object away from the robot. The vector between both hands is no such direction,
    as the hands are side by side. None if the hand is straight above or below the base.
    """
    level = np.array([person_m[0], person_m[1], 0.0])
    size = float(np.linalg.norm(level))
    return level / size if size > 0.0 else None

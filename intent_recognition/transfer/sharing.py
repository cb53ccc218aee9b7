# SPDX-License-Identifier: Apache-2.0
"""How two hands share a load, and how hard to grip for it: pure functions.

People who give an object let their grip force fall linearly with the load that they still carry
(Chan, Parker, Van der Loos and Croft 2012, "Grip forces and load forces in handovers: implications
for designing human-robot handover controllers", HRI; 2013, "A human-inspired object handover
controller", IJRR 32(8)). Forces are those on the robot's hand, in world axes, z up.
"""

import numpy as np

from intent_recognition.array_types import Floats

LIGHTEST_N = 3.0
"""What a person takes over counts as a share of the weight, and of no less than this [N]: five
standard deviations of the load that is measured on the simulated LWR at rest."""
FIRM_N = 12.0
"""Grip of something without weight [N]: with the friction of rubber on plastic (0.6) its two
fingers hold 14 N, the largest force that a transfer may have."""
GRIP_PER_LOAD = 1.5
"""Grip force by load that the fingers must hold. People have 1 to 2 (Chan et al. 2012, Section IV);
with friction 0.6 it takes 0.83 to hold at all."""
MOST_N = 70.0
"""Strongest grip [N]: what the Franka Hand holds continuously."""


def load_share(force_n: Floats, weight_n: float, toward: Floats | None) -> float:
    """Share of the load that the person has taken over, 0 to 1.

    Lifting counts, and pulling toward the person; pressing down and pushing count against it.

    The force is on the hand (3,); `toward` is the horizontal unit vector to the person (3,); None:
    any horizontal way.
    """
    lifted = float(force_n[2]) + weight_n
    pulled = np.hypot(force_n[0], force_n[1]) if toward is None else float(force_n @ toward)
    return float(np.clip((lifted + pulled) / max(weight_n, LIGHTEST_N), 0.0, 1.0))


def carrying_grip(load_n: float) -> float:
    """Grip force [N] of each finger that holds a load [N] whatever happens on the way."""
    return min(FIRM_N + GRIP_PER_LOAD * load_n, MOST_N)


def offering_grip(share: float, weight_n: float) -> float:
    """Grip force [N] while the person has taken over a share of the weight [N]: linear in it."""
    least_n = 2.0  # while the person carries all: the fingers stay on
    return least_n + (carrying_grip(weight_n) - least_n) * (1.0 - share)


def away_from_base(person_m: Floats) -> Floats | None:
    """`toward` of `load_share`, by where the person's hand is from the robot's base (3,).

    Who takes an object brings it away from the robot. The way from the hand of one to that of the
    other is no such direction: they are beside one another. None straight above or below.
    """
    level = np.array([person_m[0], person_m[1], 0.0])
    size = float(np.linalg.norm(level))
    return level / size if size > 0.0 else None

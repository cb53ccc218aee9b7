# SPDX-License-Identifier: Apache-2.0
"""Plan a pour as poses of the hand that holds the cup, from the learned skill and seen containers.

The primitive is conditioned on the containers' parameters and positions: the cup's lip begins and
ends where it is now, relative to the second opening. All positions are in one frame with z up.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from intent_recognition.array_types import Floats
from intent_recognition.errors import ArgumentError
from intent_recognition.promp import InteractionProMP, via_point
from intent_recognition.signals import homogeneous
from intent_recognition.warping.parameters import References
from intent_recognition.warping.pour_level import Emptying, Reached, amount_to_leave, tilts_to_level
from intent_recognition.warping.primitives import N_WARPED, WarpedPrimitive

UP = np.array([0.0, 0.0, 1.0])


class PouringSkill(NamedTuple):
    """A skill learned from demonstrated pours."""

    primitive: WarpedPrimitive  # primitive in the warped space
    far: Reached  # how far the demonstrated pours tilt the cup


class SeenContainer(NamedTuple):
    """A container that was seen, with its warped parameters."""

    references: References  # values by which its variables are divided
    opening_m: Floats  # centre of its opening (3,)
    lip_m: Floats  # point of the rim over which it pours (3,)
    up: Floats  # unit axis (3,) out of its opening
    emptying: Emptying  # how much it can hold at each tilt


class PourPlan(NamedTuple):
    """A pour to execute."""

    times_s: Floats  # times from 0 (T,)
    hand_poses: Floats  # poses of the hand (T, 4, 4)
    # translation [m] and rotation [rad] of the hand for one standard deviation of each of the
    # primitive's four DOFs (T, 6, 4)
    hand_std: Floats
    left: float  # content left in the cup at the end, as a share of its volume


def pour_axes(cup: SeenContainer) -> Floats:
    """Unit axes along the pour, across it (to the left) and up, as columns (3, 3)."""
    along = (cup.lip_m - cup.opening_m) * [1.0, 1.0, 0.0]
    along = along / np.linalg.norm(along)
    return np.column_stack([along, np.cross(UP, along), UP])


def conditioned(skill: PouringSkill, cup: SeenContainer, second: SeenContainer) -> InteractionProMP:
    """The learned pour, given the containers and their positions.

    It begins and ends at rest and upright, with the lip where it is now.
    """
    given = skill.primitive.given(cup.references, second.references)
    stand = np.append((cup.lip_m - second.opening_m) @ pour_axes(cup), 0.0)
    for time_s in (0.0, given.duration_s):
        given = via_point(given, time_s, stand)
        given = via_point(given, time_s, np.zeros(N_WARPED), velocity=True)
    return given


def plan_pour(
    skill: PouringSkill,
    cup: SeenContainer,
    second: SeenContainer,
    hand: Floats,
    asked: str,
    fluid: float,
) -> PourPlan:
    """Poses of the hand for a pour from where the cup is, and back.

    Args:
        skill: the learned skill.
        cup: the container in the hand, upright.
        second: the other container.
        hand: pose of the hand (4, 4) that holds the cup.
        asked: "empty", "full" or millilitres; see `amount_to_leave`.
        fluid: content of the cup, as a share of its volume.

    Raises:
        ArgumentError: the cup is tilted, or the amount cannot be poured.
    """
    tilted = float(np.arccos(np.clip(cup.up @ UP, -1.0, 1.0)))
    if tilted > 0.1:  # a compliant arm sags by less
        got = f"one tilted by {np.degrees(tilted):.0f} degrees"
        raise ArgumentError.about("cup", "an upright one", got, "Hold it upright.")
    own, other = cup.references, second.references
    left = amount_to_leave(asked, fluid * own.volume_m3, other.volume_m3) / own.volume_m3
    primitive = conditioned(skill, cup, second)
    found = primitive.predict_controlled(round(primitive.duration_s / 0.1) + 1)
    path = found.positions
    tilt = tilts_to_level(path[:, 3] / own.tilt_rad, skill.far, cup.emptying, fluid, left)
    axes = pour_axes(cup)
    lip = second.opening_m + path[:, :3] @ axes.T
    turn = Rotation.from_rotvec(np.outer(tilt, axes[:, 1])).as_matrix()
    reach = turn @ (hand[:3, 3] - cup.lip_m)
    poses = homogeneous(turn @ hand[:3, :3], lip + reach)
    moves = np.zeros((len(path), 6, N_WARPED))
    moves[:, :3, :3] = axes
    moves[:, :3, 3] = np.cross(axes[:, 1], reach)
    moves[:, 3:, 3] = axes[:, 1]
    return PourPlan(found.times_s, poses, moves * found.std[:, None, :], left)

# SPDX-License-Identifier: Apache-2.0
"""Pours with pairs of containers that were never demonstrated, recorded as bags.

Each pair is poured with along the primitive's mean and along one drawn path, both rescaled by
warped parameters, and, for comparison, along the mean with the demonstrated pair's references.
The demonstrations must be below the output folder.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import numpy as np

from experiments.pouring.checking import HIGHEST_RISK, Constraints, learn_constraints
from experiments.pouring.pour import AssumedGeometry, Poured, pour
from experiments.pouring.recordings import joint_messages, labels_of
from experiments.recording import PROVENANCE, Content, recorded_at_ns
from intent_recognition.errors import KinematicsError
from intent_recognition.warping import EMPTY, Reached, References, WarpedPrimitive, amount_to_leave
from sim_bridge.scenarios.pouring import (
    HALF_FULL,
    N_BALLS,
    PAIRS,
    TASK,
    PourLevel,
    PourPath,
    Seen,
    container_named,
    half_full_radius_m,
    learn_pouring_skill,
    plan,
    read_demonstrated,
    seen_as,
)

MEAN, UNWARPED, SAMPLE = MANNERS = ("mean", "unwarped", "sample")
LEVELS = {"tea_cup": (25, 50, 75), "round_bowl": (70, 140, 210)}
"""Millilitres asked of the two cups that a ratio of tilts does not empty."""
DRAWS = 20
"""Most paths that are drawn until one is expected to spill nothing."""
EVERY = 2
"""Samples of 10 ms per recorded one, to keep the bags small."""

_STREAM = 62
"""Keeps this scenario's random numbers apart from those of others with the same seed."""


@dataclass(frozen=True)
class PourOrder:
    """One pour to make: which pair, along which path, how much.

    Attributes:
        seed: of the scans and the balls.
        pair: index of `PAIRS`.
        manner: one of `MANNERS`.
        pour: "empty", "full" or millilitres; "" pours along the rescaled path alone.
    """

    seed: int
    pair: int
    manner: str
    pour: str = ""

    @property
    def name(self) -> str:
        """Name of the bag, such as mug_tumbler_mean."""
        return f"{'_'.join(PAIRS[self.pair])}_{self.pour or self.manner}"

    @property
    def folder(self) -> PurePosixPath:
        """Where the bag goes, below the folder for all bags."""
        return PurePosixPath("pouring", "executed", self.name)

    @property
    def start_ns(self) -> int:
        """Stamp of the first sample: one pour a minute."""
        place = len(MANNERS) * self.pair + MANNERS.index(self.manner)
        if self.pour:
            place = len(MANNERS) * len(PAIRS) + _levels(self.seed).index(self)
        return recorded_at_ns(6100 + place)

    def rng(self, purpose: int) -> np.random.Generator:
        """Random numbers for one purpose; how the balls lie is the same for every manner."""
        return np.random.default_rng([self.seed, _STREAM, self.pair, purpose])


class Skill(NamedTuple):
    """What was learned with the demonstrated pair.

    Attributes:
        primitive: in the warped space.
        cup: the demonstrated cup as scanned.
        second: the demonstrated second container as scanned.
        constraints: of pouring and filling.
        far: how far the demonstrated pours tilt the cup.
    """

    primitive: WarpedPrimitive
    cup: Seen
    second: Seen
    constraints: Constraints
    far: Reached


class Planned(NamedTuple):
    """A path for one pair, and what is known before it is executed.

    Attributes:
        path: of the lip.
        cup: as scanned.
        second: as scanned.
        risk: highest probability of a spill along the path, by the learned constraints.
        draws: how many paths were drawn until one was let through; 0 for a mean.
        left_m3: what is to be left in the cup; None where no level was asked for.
    """

    path: PourPath
    cup: Seen
    second: Seen
    risk: float
    draws: int
    left_m3: float | None = None


def orders(seed: int) -> list[PourOrder]:
    """Every pour."""
    every = [PourOrder(seed, k, manner) for manner in MANNERS for k in range(len(PAIRS))]
    return every + _levels(seed)


def _levels(seed: int) -> list[PourOrder]:
    """Every pour to a level: all pairs to the last, and two of them to less."""
    less = [
        PourOrder(seed, k, MEAN, str(amount))
        for k, (cup, _) in enumerate(PAIRS)
        for amount in LEVELS.get(cup, ())
    ]
    return [PourOrder(seed, k, MEAN, EMPTY) for k in range(len(PAIRS))] + less


@cache
def learn_skill(demonstrations: Path, seed: int) -> Skill:
    """Learn the primitive from a folder of bags, and the constraints from the shipped trials."""
    shown = read_demonstrated(demonstrations)
    cup, second = (seen_as(name, seed) for name in (shown.cup, shown.second))
    constraints = learn_constraints(shown.cup, lambda name: seen_as(name, seed))
    primitive, far = learn_pouring_skill(demonstrations, seed)
    return Skill(primitive, cup, second, constraints, far)


def planned(order: PourOrder, skill: Skill) -> Planned:
    """The path of an order, checked against the learned constraints.

    Raises:
        KinematicsError: none of the paths drawn is expected to spill nothing.
    """
    cup, second = (seen_as(name, order.seed) for name in PAIRS[order.pair])

    def risk(path: PourPath) -> float:
        found = skill.constraints.risk(path, cup.references, second.references)
        return float(found.max())

    if order.pour:
        level = asked_level(skill.far, order.pour, cup, second.references)
        path = plan(skill.primitive, cup.references, second.references, level=level)
        left_m3 = level.left * cup.references.volume_m3
        return Planned(path, cup, second, risk(path), 0, left_m3)
    if order.manner != SAMPLE:
        as_cup, as_second = (skill.cup, skill.second) if order.manner == UNWARPED else (cup, second)
        path = plan(skill.primitive, as_cup.references, as_second.references)
        return Planned(path, cup, second, risk(path), 0)
    rng = order.rng(1)
    for draw in range(1, DRAWS + 1):
        path = plan(skill.primitive, cup.references, second.references, rng)
        if risk(path) < HIGHEST_RISK:
            return Planned(path, cup, second, risk(path), draw)
    cure = "Demonstrate with containers more like these."
    got = f"none of {DRAWS} for {PAIRS[order.pair]}"
    raise KinematicsError.about("path", "one expected to spill nothing", got, cure)


def asked_level(far: Reached, asked: str, cup: Seen, second: References) -> PourLevel:
    """The level asked of a pour from a half full cup, as `warping.amount_to_leave` reads it."""
    volume_m3 = cup.references.volume_m3
    left_m3 = amount_to_leave(asked, HALF_FULL * volume_m3, second.volume_m3)
    return PourLevel(far, cup.emptying, HALF_FULL, left_m3 / volume_m3)


def execute(order: PourOrder, plan_: Planned) -> Poured:
    """Let the torque-controlled arm pour forty balls that fill half of the cup."""
    cup, second = (container_named(name) for name in PAIRS[order.pair])
    return pour(
        plan_.path,
        cup,
        second,
        ball_radius_m=half_full_radius_m(cup),
        n_balls=N_BALLS,
        rng=order.rng(0),
        belief=AssumedGeometry(plan_.cup.lip_m, plan_.second.opening_m),
    )


def content(order: PourOrder, bags: Path) -> Content:
    """Plan and pour, with the skill of the demonstrations below `bags`: metadata and messages."""
    plan_ = planned(order, learn_skill(bags / "pouring" / "train", order.seed))
    poured = execute(order, plan_)
    cup, second = PAIRS[order.pair]
    metadata = {
        "task": TASK,
        "set": "executed",
        **PROVENANCE,
        "seed": str(order.seed),
        "pair": str(order.pair),
        "manner": order.manner,
        **({"pour": order.pour} if order.pour else {}),
        **labels_of(container_named(cup), cup, second, poured),
        "risk": f"{plan_.risk:.6f}",
        "draws": str(plan_.draws),
        **({} if plan_.left_m3 is None else {"left_ml": f"{1e6 * plan_.left_m3:.3f}"}),
        "through_wall": str(poured.through_wall),
        "saturated_steps": str(poured.saturated_steps),
    }
    noise = order.rng(2 + MANNERS.index(order.manner))
    return metadata, joint_messages(order.start_ns, poured, noise, every=EVERY)

# SPDX-License-Identifier: Apache-2.0
"""Practise pouring: the search space of the warped primitive, and rollouts in fast physics."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from intent_recognition import __version__
from intent_recognition.array_types import Floats
from intent_recognition.bags import JOINT_STATE, BagWriter
from intent_recognition.errors import ArgumentError, KinematicsError
from intent_recognition.improvement import N_PHASES, Rollout, SearchSpace, search_space
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS
from intent_recognition.warping import PouringSkill
from sim_bridge.containers import CONTAINER_SEED
from sim_bridge.scenarios.pouring.ball_pour import N_FILLS, BallPours, capacity
from sim_bridge.scenarios.pouring.novel import (
    HALF_FULL,
    JOINT_TOPIC,
    N_BALLS,
    TASK,
    DemonstratedPours,
    PourLevel,
    container_named,
    half_full_radius_m,
    learn_pouring,
    plan,
    seen_as,
)
from sim_bridge.scenarios.pouring.task_space import OPENING_M, PourPath, SideGrasp, plan_joints

EPOCH_NS, MINUTE_NS, LOGGED_NS = 1_767_765_600_000_000_000, 60_000_000_000, 20_000_000
"""Stamp of rollout 0, on the day of all recordings; time between rollouts; and time between logged
samples [ns]."""
SHORT_STD_RADII = 0.3
"""Standard deviation by which moved demonstrations vary along the pour, in radii of the opening, so
that practice can find the opening."""


class _Planned(NamedTuple):
    """A path of the lip, and the arm's joints along it."""

    path: PourPath
    joints: CubicSpline


class PouringPractice(AbstractContextManager["PouringPractice"]):
    """Rollouts of one skill with one pair of containers; a context manager.

    They pour like the nodes, with the containers' parameters estimated from scans. The arm is not
    simulated, but a path must be within its reach and its position and velocity limits. `wanted` is
    the number of balls to be poured into the second container, by default all.

    Raises:
        ArgumentError: there is no such container, or `wanted` balls cannot be poured.
    """

    costs = ("spilled", "level")
    step = 1.0

    def __init__(self, skill: PouringSkill, cup: str, second: str, wanted: int = N_BALLS) -> None:
        self.skill, self.names, self._wanted = skill, (cup, second), wanted
        self._cup, poured_into = container_named(cup), container_named(second)
        radius_m = half_full_radius_m(self._cup)
        most = min(N_BALLS, capacity(poured_into, radius_m))
        if not 1 <= wanted <= most:
            cure = f"{second} holds no more. Ask for fewer, or name a larger one."
            raise ArgumentError.about("wanted", f"1 to {most} balls", wanted, cure)
        self._seen, self._seen_second = (seen_as(name, 1) for name in self.names)
        left = HALF_FULL * (1.0 - wanted / N_BALLS)
        self._level = PourLevel(skill.far, self._seen.emptying, HALF_FULL, left)
        self._pours = BallPours(self._cup, poured_into, radius_m, N_BALLS)
        self._last: tuple[Floats, _Planned] | None = None

    @cached_property
    def space(self) -> SearchSpace:
        """Search space spanned by the primitive's own spread."""
        primitive = self.skill.primitive
        basis = primitive.basis.design_matrix(np.linspace(0.0, 1.0, N_PHASES))
        mean, n_dofs = primitive.mean, primitive.mean.size // basis.shape[1]
        design = np.einsum("qp,mn->qmpn", np.eye(n_dofs), basis)
        return search_space(mean, primitive.spread, design.reshape(n_dofs, N_PHASES, mean.size))

    def path(self, weights: Floats) -> PourPath:
        """The path of the lip for weights (d,)."""
        return plan(
            self.with_mean(weights).primitive,
            self._seen.references,
            self._seen_second.references,
            level=self._level,
        )

    def with_mean(self, weights: Floats) -> PouringSkill:
        """The skill with weights (d,) as the mean."""
        primitive, far = self.skill
        return PouringSkill(replace(primitive, mean=weights), far)

    def keeps_limits(self, weights: Floats) -> bool:
        """Whether the arm can follow the path within its reach and velocity limits."""
        try:
            joints = self._planned(weights).joints
        except KinematicsError:
            return False
        fastest = np.abs(joints(joints.x, 1)).max(axis=0)
        return bool(np.all(fastest <= LWR_LIMITS.velocity))

    def rollout(self, weights: Floats, rng: np.random.Generator) -> list[Rollout]:
        """Pour once, with a drawn arrangement of the balls."""
        return [self._rollout(weights, int(rng.integers(N_FILLS)))]

    def check(self, weights: Floats, count: int) -> list[Rollout]:
        """Pour `count` times, with arrangements of the balls that `rollout` never uses."""
        return [self._rollout(weights, N_FILLS + k) for k in range(count)]

    def _rollout(self, weights: Floats, fill: int) -> Rollout:
        path, joints = self._planned(weights)
        counts = self._pours.pour(path, fill)
        times = np.arange(0.0, joints.x[-1], LOGGED_NS * 1e-9)
        outcome = {name: float(n) for name, n in counts._asdict().items()}
        return Rollout(times, joints(times), {**outcome, "wanted": float(self._wanted)})

    def write(self, folder: Path, rollouts: Sequence[Rollout], labels: Mapping[str, str]) -> None:
        """Write a rollout as a bag that `read_pour` can read.

        Raises:
            ResourceBusyError: the directory exists already.
        """
        (rollout,) = rollouts
        joints, zero = rollout.joints_rad, np.zeros(rollout.joints_rad.shape[1])
        rates = np.gradient(joints, rollout.times_s, axis=0)
        start = EPOCH_NS + int(labels["rollout"]) * MINUTE_NS
        metadata = {
            "task": TASK,
            "set": "practice",
            "simulated": "true",
            "generator": "intent improve",
            "generator_version": __version__,
            "cup": self.names[0],
            "second": self.names[1],
            "container_seed": str(CONTAINER_SEED),
            "opening_m": _vector(OPENING_M),
            "lip_m": _vector(self._cup.lip_point),
            "height_m": f"{self._cup.height_m:.6f}",
            **{name: f"{value:g}" for name, value in rollout.outcome.items()},
            **labels,
        }
        with BagWriter(folder, metadata, flush_period_s=None) as bag:
            for k, (q, qd) in enumerate(zip(joints, rates, strict=True)):
                stamp = start + k * LOGGED_NS
                names = {"header": {"stamp": stamp}, "name": list(JOINT_NAMES)}
                bag.write_message(
                    JOINT_TOPIC,
                    JOINT_STATE,
                    names | {"position": q, "velocity": qd, "effort": zero},
                    stamp,
                )

    def _planned(self, weights: Floats) -> _Planned:
        """The path for weights (d,); the last one is cached."""
        if self._last is None or not np.array_equal(self._last[0], weights):
            path = self.path(weights)
            joints = plan_joints(path, SideGrasp(self._cup.lip_point, self._cup.height_m))
            self._last = weights.copy(), _Planned(path, joints)
        return self._last[1]

    def __exit__(self, *args: object) -> None:
        self._pours.__exit__(*args)


def short_skill(shown: DemonstratedPours, short_radii: float, seed: int) -> PouringSkill:
    """Learn a skill from demonstrations moved so that they pour too short, for practice.

    Each is moved by its own draw, on average by `short_radii` radii of the second opening.
    """
    cup, second = (seen_as(name, 1) for name in (shown.cup, shown.second))
    radius, height = second.references.opening_radius_m, cup.references.height_m
    rng = np.random.default_rng([seed, 71])  # for these draws only
    pours = []
    for pour in shown.pours:
        ratios = np.append(-short_radii + SHORT_STD_RADII * rng.standard_normal(), [0.0, 0.0])
        ratios += [0.0, 0.1, 0.08] * rng.standard_normal(3)  # variation across and up
        moved = pour.offset_m + ratios * [radius, radius, height]
        pours.append(PourPath(pour.times_s, moved, pour.tilt_rad))
    return learn_pouring(pours, cup, second)


def _vector(values: Floats) -> str:
    """Numbers in the format of metadata: six decimals, separated by spaces."""
    return " ".join(f"{value:.6f}" for value in values)

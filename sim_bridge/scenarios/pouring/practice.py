# SPDX-License-Identifier: Apache-2.0
"""Practising to pour: the search space of the warped primitive, and rollouts in quick physics."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from intent_recognition.errors import KinematicsError
from intent_recognition.improvement import SearchSpace, search_space
from intent_recognition.kinematics import LWR_LIMITS
from intent_recognition.warping import PouringSkill, WarpedPrimitive
from sim_bridge.balls import CONTAINER_SEED
from sim_bridge.practice import Rollout
from sim_bridge.scenarios.pouring.ball_pour import N_FILLS, BallPours
from sim_bridge.scenarios.pouring.executed import container_named, seen_as
from sim_bridge.scenarios.pouring.novel import plan, reached_by
from sim_bridge.scenarios.pouring.recordings import (
    N_BALLS,
    TASK,
    half_full_radius_m,
    true_references,
)
from sim_bridge.scenarios.pouring.task_space import OPENING_M, Grasp, PourPath
from sim_bridge.teaching import (
    JOINT_TOPIC,
    JOINT_TYPE,
    PROVENANCE,
    joint_fields,
    metadata_vector,
    recorded_at_ns,
    write_recording,
)

N_PHASES = 50
"""Phases at which paths are compared. Convention."""
LOGGED_NS = 20_000_000
"""Time between two samples of a logged rollout [ns]. Convention."""


class PouringPractice:
    """Rollouts of one primitive with one pair of containers; use as a context.

    The arm is not simulated: a path has to be within its reach and its limits of position and
    velocity.

    Args:
        primitive: in the warped space.
        cup, second: names of the containers.
        wanted: balls that are to be in the second one.
    """

    def __init__(
        self, primitive: WarpedPrimitive, cup: str, second: str, wanted: int = N_BALLS
    ) -> None:
        self.primitive, self.names, self._wanted = primitive, (cup, second), wanted
        self._cup, self._second = container_named(cup), container_named(second)
        radius = half_full_radius_m(self._cup)
        self._pours = BallPours(self._cup, self._second, radius, N_BALLS)

    @cached_property
    def space(self) -> SearchSpace:
        """The primitive's own spread."""
        basis = self.primitive.basis.design_matrix(np.linspace(0.0, 1.0, N_PHASES))
        mean, n_dofs = self.primitive.mean, self.primitive.mean.size // basis.shape[1]
        design = np.einsum("qp,mn->qmpn", np.eye(n_dofs), basis)
        return search_space(
            mean, self.primitive.spread, design.reshape(n_dofs, N_PHASES, mean.size)
        )

    def path(self, weights: NDArray[np.float64]) -> PourPath:
        """The path of the lip of some weights (d,)."""
        changed = replace(self.primitive, mean=weights)
        return plan(changed, true_references(self._cup), true_references(self._second))

    def keeps_limits(self, weights: NDArray[np.float64]) -> bool:
        """Whether the arm reaches all of the path, and is nowhere faster than it can be."""
        try:
            joints = self._joints(weights)
        except KinematicsError:
            return False
        fastest = np.abs(joints(joints.x, 1)).max(axis=0)
        return bool(np.all(fastest <= LWR_LIMITS.velocity))

    def rollout(self, weights: NDArray[np.float64], rng: np.random.Generator) -> Rollout:
        """Pour once; how the balls lie is drawn."""
        count = self._pours.pour(self.path(weights), int(rng.integers(N_FILLS)))
        joints = self._joints(weights)
        times = np.arange(0.0, joints.x[-1], LOGGED_NS * 1e-9)
        outcome = {name: float(n) for name, n in count._asdict().items()}
        return Rollout(times, joints(times), {**outcome, "wanted": float(self._wanted)})

    def skill(self, weights: NDArray[np.float64], seed: int) -> PouringSkill:
        """What some weights (d,) pour, as learned with this cup, seen in a scan with this seed.

        Raises:
            ArgumentError: they do not empty the cup further than it is at first.
        """
        changed = replace(self.primitive, mean=weights)
        return PouringSkill(changed, reached_by(changed, seen_as(self.names[0], seed)))

    def write(self, folder: Path, rollout: Rollout, labels: Mapping[str, str]) -> None:
        """Write a rollout as a bag, which `read_pour` reads.

        Raises:
            ResourceBusyError: the directory exists already.
        """
        joints, zero = rollout.joints_rad, np.zeros(rollout.joints_rad.shape[1])
        rates = np.gradient(joints, rollout.times_s, axis=0)
        start = recorded_at_ns(9000 + int(labels["rollout"]))
        metadata = {
            "task": TASK,
            "set": "practice",
            **PROVENANCE,
            "generator": "intent improve",
            "cup": self.names[0],
            "second": self.names[1],
            "container_seed": str(CONTAINER_SEED),
            "opening_m": metadata_vector(OPENING_M),
            "lip_m": metadata_vector(self._cup.lip_point),
            "height_m": f"{self._cup.height_m:.6f}",
            **{name: f"{value:g}" for name, value in rollout.outcome.items()},
            **labels,
        }
        stamps = [start + k * LOGGED_NS for k in range(len(joints))]
        said = (
            (JOINT_TOPIC, JOINT_TYPE, stamp, joint_fields(stamp, q, qd, zero))
            for stamp, q, qd in zip(stamps, joints, rates, strict=True)
        )
        write_recording(folder, metadata, said)

    def _joints(self, weights: NDArray[np.float64]) -> CubicSpline:
        from sim_bridge.scenarios.pouring.pour import plan_joints

        return plan_joints(self.path(weights), Grasp(self._cup.lip_point, self._cup.height_m))

    def __enter__(self) -> "PouringPractice":
        """Return itself."""
        return self

    def __exit__(self, *args: object) -> None:
        """End the physics."""
        self._pours.__exit__(*args)

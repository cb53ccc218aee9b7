# SPDX-License-Identifier: Apache-2.0
"""Practice of a taught task: varies the robot's part beside recorded people.

The robot follows the person by the rule w_c = A (w_o - m) + mu + e. Practice searches for other
controlled weights mu + d and for the logarithm u of the pace at which the robot runs ahead of the
person. Let M(u) w be the weights of w's path evaluated at the phases min(z exp(u), 1). Then

    w_c = M(u) (A (w_o - m) + mu + d) + e.

(d, u) is Gaussian as demonstrated: d has the covariance of the controlled weights, u the timing
prior of the task. Recognition and the people's movements do not change.

A rollout is kinematic: it executes the plan that `primitive_activation` makes for the predicted
path, from the rest posture and from the usual time of the decision, beside some of the people.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from intent_recognition.array_types import Floats, Integers
from intent_recognition.demonstrations import DofSpec, position_columns
from intent_recognition.errors import ArgumentError, TrajectoryError
from intent_recognition.improvement.cost import Rollout
from intent_recognition.improvement.search import SearchSpace, search_space
from intent_recognition.kinematics import JOINT_NAMES, LWR_LIMITS, Arm, hand_position
from intent_recognition.learning import (
    RuleChange,
    Trained,
    TrainingExample,
    inferred_weights,
    sample_phases,
)
from intent_recognition.motion import (
    JointPlan,
    JointReference,
    NominalTiming,
    make_path,
    plan_interaction,
    scaled_limits,
)
from intent_recognition.promp import NormalizedRBFBasis
from intent_recognition.tables import EntrySamples, ImportedDemonstration

N_PHASES = 50
"""Number of phases at which paths are compared: every 2 % of a movement."""
DECIDED_SHARE = 0.2
"""Share of the movement at which the arm starts: the median measured in `make demo` (README)."""
NEAR_M = 0.03
"""Distance from its goal at which a hand counts as arrived [m]: a person reaches over it without a
step."""


class Person(NamedTuple):
    """A recorded person and the robot's task beside this person."""

    duration_s: float  # duration of the interaction
    hand_m: Floats  # position of the person's hand at `sample_phases()`, (m, 3)
    weights: Floats  # weights of the robot's path by the rule, (Q N,)
    place_m: Floats  # goal of the robot's hand (3,)


def check_task(task: str, labels: Sequence[str]) -> None:
    """Raise ArgumentError if a library with these labels has no such task."""
    if task not in labels:
        cure = "Check the spelling, or teach it first."
        raise ArgumentError.about("TASK", f"one of {', '.join(labels)}", task, cure)


class TaskPractice:
    """Rollouts of one task of a library.

    The practised weights are the controlled ones and u, (Q N + 1,). The goal of the robot's hand is
    `beside_m` (3,) [m] from where the person's hand comes to rest, in the frame of the arm's base;
    by default it is the demonstrated one. `moved_m` is added to it. Without `arm` the joints are
    the LWR's. A rollout includes at most `most_people` people.

    Raises:
        ArgumentError: no such task, the person's hand is not observed, or the arm has other joints.
    """

    costs = ("distance", "time")
    step = 0.5

    def __init__(
        self,
        trained: Trained,
        dofs: DofSpec,
        task: str,
        *,
        beside_m: Sequence[float] | None = None,
        moved_m: Sequence[float] = (0.0, 0.0, 0.0),
        arm: Arm | None = None,
        most_people: int = 8,
    ) -> None:
        library = trained.library
        check_task(task, library.labels)
        joints = JOINT_NAMES if arm is None else arm.joint_names
        if library.controlled_names != tuple(joints):
            expected = f"a task that controls {', '.join(joints)}"
            got = ", ".join(library.controlled_names)
            cure = "Name the URDF of the arm that was taught with --robot."
            raise ArgumentError.about(task, expected, got, cure)
        self.task, self._library, self._dofs, self._arm = task, library, dofs, arm
        self._number, self._most = library.labels.index(task), most_people
        self._limits = scaled_limits(LWR_LIMITS if arm is None else arm.limits)
        self._beside_m, self._moved_m = beside_m, np.array(moved_m)
        columns = _hand_columns(dofs)
        rule, n = library.regressions[self._number], library.n_observed_weights
        examples = trained.tasks[task].examples
        self._mean = library.weight_mean[self._number, n:]
        self._rest = np.mean([one.controlled[0] for one in examples], axis=0)
        self._people = [
            self._person(one, columns, rule.matrix @ w + rule.offset)
            for one in examples
            for w in [inferred_weights(trained, one)]
        ]

    @cached_property
    def space(self) -> SearchSpace:
        """Search space of the robot's path and its timing."""
        library, phases = self._library, np.linspace(0.0, 1.0, N_PHASES)
        basis, n_dofs = library.basis, library.n_controlled
        n = library.n_observed_weights
        values, vectors = np.linalg.eigh(library.weight_covariance[self._number][n:, n:])
        spread = np.zeros((len(self._mean) + 1, len(values) + 1))
        spread[:-1, :-1] = vectors * np.sqrt(np.maximum(values, 0.0))
        spread[-1, -1] = library.log_duration_std[self._number]
        design = np.zeros((n_dofs, N_PHASES, len(self._mean) + 1))
        each = np.einsum("qp,mn->qmpn", np.eye(n_dofs), basis.design_matrix(phases))
        design[:, :, :-1] = each.reshape(n_dofs, N_PHASES, -1)
        slope = basis.derivative_matrix(phases) @ self._mean.reshape(n_dofs, -1).T
        design[:, :, -1] = (phases[:, None] * slope).T
        return search_space(np.append(self._mean, 0.0), spread, design)

    def keeps_limits(self, weights: Floats) -> bool:
        """Whether the path beside each person keeps the arm's position limits."""
        phases = np.linspace(0.0, 1.0, N_PHASES)
        paths = np.array([self._path(person, weights, phases) for person in self._people])
        return bool(np.all((paths >= self._limits.lower) & (paths <= self._limits.upper)))

    def rollout(self, weights: Floats, rng: np.random.Generator) -> list[Rollout]:
        """Execute weights beside every second person, or beside a sample of these people."""
        practised = self._people[::2]
        if len(practised) > self._most:
            drawn = rng.choice(len(practised), self._most, replace=False)
            practised = [practised[k] for k in sorted(drawn)]
        return [self._execute(person, weights) for person in practised]

    def check(self, weights: Floats, count: int) -> list[Rollout]:
        """Execute weights once beside each of the other people, whatever `count` is."""
        return [self._execute(person, weights) for person in self._people[1::2] or self._people]

    def change(self, weights: Floats) -> RuleChange:
        """Change of the rule by practised weights."""
        warped = warping_matrix(self._library.basis, weights[-1])
        every = np.kron(np.eye(self._library.n_controlled), warped)
        matrix = self._library.regressions[self._number].matrix
        return RuleChange(every @ matrix - matrix, every @ weights[:-1] - self._mean)

    def write(self, folder: Path, rollouts: Sequence[Rollout], labels: Mapping[str, str]) -> None:
        """Write a bag for each person, in the form of a recorded demonstration."""
        for number, one in enumerate(rollouts):
            stamps = np.round((one.times_s + 1.0) * 1e9).astype(np.int64)
            outcome = {name: f"{value:.4f}" for name, value in one.outcome.items()}
            known = {"task": self.task, "set": "practice", "simulated": "true"}
            samples = self._samples(stamps, one)
            bag = ImportedDemonstration(f"{number:02d}", {**known, **outcome, **labels}, samples)
            bag.write(folder)

    def _samples(self, stamps: Integers, one: Rollout) -> tuple[EntrySamples, ...]:
        person = self._dofs.observed[0]
        columns = position_columns(person) or []
        values = np.full((len(stamps), len(person.fields)), np.nan)
        if one.person_m is not None:
            values[:, columns] = one.person_m
        found = [EntrySamples(person, stamps, values)] if not np.any(np.isnan(values)) else []
        start = 0
        for entry in self._dofs.controlled:
            end = start + len(entry.names)
            found.append(EntrySamples(entry, stamps, one.joints_rad[:, start:end]))
            start = end
        return tuple(found)

    def _person(self, example: TrainingExample, columns: list[int], weights: Floats) -> Person:
        hand_m = example.observed[:, columns]
        place_m = self._hand(example.controlled[-1:])[0]
        if self._beside_m is not None:
            place_m = hand_m[-1] + np.array(self._beside_m)
        return Person(example.duration_s, hand_m, weights, place_m + self._moved_m)

    def _hand(self, joints: Floats) -> Floats:
        """Positions of the hand (T, 3) [m] for joints (T, n)."""
        if self._arm is None:
            return hand_position(joints)
        return self._arm.forward_kinematics(joints)[:, :3, 3]

    def _path(self, person: Person, weights: Floats, phases: Floats) -> Floats:
        """Joints (T, n) at phases (T,) of the person's movement."""
        library, basis = self._library, self._library.basis
        moved = (person.weights + weights[:-1] - self._mean).reshape(library.n_controlled, -1)
        ahead = np.minimum(phases * np.exp(weights[-1]), 1.0)
        scaling = library.in_durations(self._number, person.duration_s)
        return basis.design_matrix(ahead) @ scaling @ moved.T

    def _plan(self, person: Person, weights: Floats) -> JointPlan | None:
        phases, duration_s = np.linspace(0.0, 1.0, N_PHASES), person.duration_s
        positions = self._path(person, weights, phases)
        try:
            path = make_path(phases * duration_s, positions, self._limits)
        except TrajectoryError:
            return None
        timing = NominalTiming(-DECIDED_SHARE * duration_s, duration_s)
        start = JointReference.at_rest(self._rest)
        return plan_interaction(path, timing, start, self._limits)

    def _execute(self, person: Person, weights: Floats) -> Rollout:
        """Execute weights beside a person; without a feasible plan the arm stays at rest."""
        plan, decided_s = self._plan(person, weights), DECIDED_SHARE * person.duration_s
        end_s = decided_s + (0.0 if plan is None else plan.duration_s)
        times = np.arange(0.0, max(end_s, person.duration_s) + 0.5, 0.02)  # plus a rest
        joints = np.tile(self._rest, (len(times), 1))
        if plan is not None:
            for k in np.flatnonzero(times >= decided_s):
                joints[k] = plan.at(times[k] - decided_s).position
        hand_m = self._hand(joints)
        seen_s = sample_phases() * person.duration_s
        person_m = np.stack([np.interp(times, seen_s, axis) for axis in person.hand_m.T], axis=1)
        waits_from_s = arrival_s(times, person_m, person_m[-1])
        outcome = {
            "distance_m": float(np.linalg.norm(hand_m[-1] - person.place_m)),
            "late_s": arrival_s(times, hand_m, person.place_m) - waits_from_s,
        }
        return Rollout(times, joints, outcome, hand_m, person_m)


def arrival_s(times_s: Floats, points_m: Floats, place_m: Floats) -> float:
    """Time from which points (T, 3), at times (T,) [s], stay within `NEAR_M` of a place.

    If they do not, they are extrapolated from the last one at 0.25 m/s, a slow reach, so that the
    cost is continuous.
    """
    far_m = np.linalg.norm(points_m - place_m, axis=1)
    outside = np.flatnonzero(far_m > NEAR_M)
    if not outside.size:
        return float(times_s[0])
    if outside[-1] + 1 < len(times_s):
        return float(times_s[outside[-1] + 1])
    return float(times_s[-1] + (far_m[-1] - NEAR_M) / 0.25)


def warping_matrix(basis: NormalizedRBFBasis, ahead: float) -> Floats:
    """Matrix M (N, N) such that M w has at each phase z the value of w at min(z exp(ahead), 1).

    It is the least-squares fit over the phase, and the identity for ahead = 0.
    """
    if ahead == 0.0:
        return np.eye(basis.n_basis)
    phases = np.linspace(0.0, 1.0, 201)
    there = basis.design_matrix(np.minimum(phases * np.exp(ahead), 1.0))
    found = np.linalg.lstsq(basis.design_matrix(phases), there, rcond=None)[0]
    return np.asarray(found, dtype=np.float64)


def _hand_columns(dofs: DofSpec) -> list[int]:
    entry = dofs.observed[0]
    columns = position_columns(entry)
    if columns is None or entry.unit != "m" or entry.orientation:
        got = f"{', '.join(entry.names)} in {entry.unit}"
        cure = "Practise a task whose first observed entry is a position."
        raise ArgumentError.about("person", "a tracked position in m", got, cure)
    return columns

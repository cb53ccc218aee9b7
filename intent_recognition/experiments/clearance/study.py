# SPDX-License-Identifier: Apache-2.0
"""Reaches of the coworker before estimator and activation, with boxes put in the arm's way.

A run is one reach and one or two boxes. The arm follows its commands exactly; nothing else differs
from what the nodes do, with a clock of 100 Hz.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from intent_recognition.activation import (
    Activation,
    ActivationSettings,
    Command,
    PredictedInteraction,
)
from intent_recognition.demonstrations import load_dofs, read_demonstrations
from intent_recognition.experiments.settings import Settings
from intent_recognition.experiments.toolbox.session import watch
from intent_recognition.kinematics import (
    LWR_LIMITS,
    Bodies,
    Box,
    JointLimits,
    hand_position,
)
from intent_recognition.learning import learn
from intent_recognition.motion import Clearance, Spread, make_path, scaled_limits
from intent_recognition.promp import NONE, TaskLibrary
from intent_recognition.recognition import IntentEstimator, decision_settings
from intent_recognition.signals import Demonstration

if TYPE_CHECKING:
    from sim_bridge.arm import Robot
    from sim_bridge.coworker import WristSamples

N_REACHES, N_BOXES = 40, 5
"""Reaches, and draws of boxes for each of them."""
N_QUICK = (3, 2)
CLEARANCE_M = 0.02
REST_S, AFTER_S, HOME_S = 1.0, 1.0, 8.0
"""Rest before a reach, watching after it, and time to go home then [s]. Convention."""
STEP_NS = 10_000_000
PREDICTED_EVERY = 4
"""Observations from one prediction to the next: 25 Hz."""
ARRIVED_M = 0.01
"""The hand has arrived when it stays this near to where it will rest [m]. Convention."""


class Frame(NamedTuple):
    """What the activation gets at one time.

    Attributes:
        now_ns: when.
        probabilities: of the labels and none; None where nothing was observed.
        log_evidence: likewise.
        prediction: where one is due.
    """

    now_ns: int
    probabilities: NDArray[np.float64] | None
    log_evidence: NDArray[np.float64] | None
    prediction: PredictedInteraction | None


class Watched(NamedTuple):
    """A reach as estimator and tracker see it.

    Attributes:
        task: of the reach.
        onset_s: when it begins, after the first sample.
        goal_m: where the wrist stops (3,), world.
        labels: of the tasks and none.
        samples: of the wrist, at rest before and after.
        frames: what the activation gets.
    """

    task: str
    onset_s: float
    goal_m: NDArray[np.float64]
    labels: tuple[str, ...]
    samples: "WristSamples"
    frames: tuple[Frame, ...]


class Executed(NamedTuple):
    """What the arm did.

    Attributes:
        positions: what it was asked for, every 10 ms (T, 7) [rad].
        interacting: until which sample it took part, before it went home.
        arrived_s: when the hand was where it stayed, after the onset; infinite if it never left.
        counts: of the activation.
        refusals: what it said about motions that would touch.
    """

    positions: NDArray[np.float64]
    interacting: int
    arrived_s: float
    counts: dict[str, int]
    refusals: tuple[str, ...]


class Run(NamedTuple):
    """One reach with boxes: unguarded and guarded, and the least distance from a box by PyBullet.

    Attributes:
        task: of the reach.
        boxes: in the way.
        free: without boxes being known.
        guarded: with them.
        free_m: least distance of the unguarded arm from a box [m]; negative inside.
        guarded_m: likewise of the guarded one.
    """

    task: str
    boxes: tuple[Box, ...]
    free: Executed
    guarded: Executed
    free_m: float
    guarded_m: float

    @property
    def outcome(self) -> str:
        """`as before`, `bent`, `partly` (begun, then refused to follow) or `refused`."""
        counts = self.guarded.counts
        if not counts.get("planned"):
            return "refused"
        if self.guarded.arrived_s == np.inf:
            return "partly"
        return "bent" if counts.get("bent") else "as before"

    @property
    def lost_s(self) -> float:
        """How much later the guarded arm arrives; infinite if it does not."""
        return self.guarded.arrived_s - self.free.arrived_s


class ClearanceStudy(NamedTuple):
    """All runs, and how many pairs of links touched at a sample of the guarded ones."""

    runs: tuple[Run, ...]
    self_contacts: int


def investigate(settings: Settings) -> ClearanceStudy:
    """Draw reaches and boxes, run each without and with the guard."""
    from sim_bridge.arm import find_robot

    library, limits = learn(toolbox_recordings(settings)), scaled_limits(LWR_LIMITS)
    robot = find_robot("lwr")
    spreads = {label: Spread.of(library.primitive(k)) for k, label in enumerate(library.labels)}
    itself = Bodies(robot.description, robot.joint_names, clearance_m=1e-3)
    n_reaches, n_boxes = N_QUICK if settings.quick else (N_REACHES, N_BOXES)
    runs, self_contacts = [], 0
    for k in range(n_reaches):
        rng = np.random.default_rng([settings.seed, 91, k])
        watched = watch_reach(library, k, rng, limits)
        free = execute(watched, library, limits, None)
        for j in range(n_boxes):
            settings.progress(0.05 + 0.9 * (k + j / n_boxes) / n_reaches, f"reach {k + 1}")
            boxes = draw_boxes(rng, robot, free)
            bodies = Bodies(robot.description, robot.joint_names, boxes, clearance_m=CLEARANCE_M)
            guarded = execute(watched, library, limits, Clearance(bodies, spreads))
            self_contacts += len(itself.contacts(guarded.positions))
            nearest = nearest_m(robot, boxes, (free.positions, guarded.positions))
            runs.append(Run(watched.task, boxes, free, guarded, *nearest))
    return ClearanceStudy(tuple(runs), self_contacts)


def toolbox_recordings(settings: Settings) -> list[Demonstration]:
    """The shipped demonstrations."""
    folders = sorted(settings.recordings("toolbox/train").glob("*_*"))
    recordings, _ = read_demonstrations(folders[::4] if settings.quick else folders, load_dofs())
    return recordings


def watch_reach(
    library: TaskLibrary, k: int, rng: np.random.Generator, limits: JointLimits
) -> Watched:
    """Show reach number k, of the tasks in turn, to a new estimator.

    Args:
        library: of the toolbox.
        k: number of the reach.
        rng: draws it and what the tracker sees.
        limits: what predicted paths are bent inside.
    """
    from sim_bridge.coworker import TASKS, draw_reach, draw_rest, sample_wrist

    task = TASKS[k % len(TASKS)]
    reach = draw_reach(rng, task, draw_rest(rng))
    until_s = REST_S + reach.duration_s + AFTER_S
    samples = sample_wrist(rng, [(REST_S, reach)], until_s, gaps_per_s=0.1)
    estimator = IntentEstimator(library)
    frames = []
    for n, seen in enumerate(watch(estimator, samples)):
        prediction = None
        if seen.estimate.moving and n % PREDICTED_EVERY == 0:
            prediction = _prediction(estimator, limits)
        estimate = seen.estimate
        evidence = estimate.log_evidence
        frames.append(Frame(estimate.stamp_ns, estimate.probabilities, evidence, prediction))
    labels = (*library.labels, NONE)
    return Watched(task, REST_S, reach.goal_m, labels, samples, tuple(frames))


def _prediction(estimator: IntentEstimator, limits: JointLimits) -> PredictedInteraction | None:
    """What `primitive_activation` reads from `intent/robot_trajectory`."""
    found = estimator.predict_controlled()
    if found is None:
        return None
    means = found.trajectory
    path = make_path(means.times_s, means.positions, limits, means.velocities)
    onset_ns = found.onset_ns + round(float(means.times_s[0]) * 1e9)
    return PredictedInteraction(found.task, onset_ns, path, {"rad": float(means.std[-1].max())})


def execute(
    watched: Watched, library: TaskLibrary, limits: JointLimits, clearance: Clearance | None
) -> Executed:
    """Let the activation act on what was watched, with an arm that follows exactly."""
    from sim_bridge.scenarios.toolbox import HOME

    refusals: list[str] = []

    def reject(reason: str, text: str) -> None:
        if reason == "would_touch":
            refusals.append(text)

    activation = Activation(
        ActivationSettings(
            limits=limits, decision=decision_settings(library), home=HOME, clearance=clearance
        ),
        reject,
    )
    commands: list[Command] = []
    positions, interacting = [], 0
    for frame in ticks(watched):
        begun = (one for one in reversed(commands) if one.start_ns <= frame.now_ns)
        in_force = next(begun, None)
        q = HOME if in_force is None else in_force.at(frame.now_ns).position
        positions.append(q)
        activation.take_joint_state(frame.now_ns, q, np.zeros_like(q))
        if frame.probabilities is not None:
            activation.take_tasks(
                frame.now_ns, frame.now_ns, watched.labels, frame.probabilities, frame.log_evidence
            )
        if frame.prediction is not None:
            activation.take_prediction(frame.now_ns, frame.prediction)
        command = activation.step(frame.now_ns)
        if command is not None:
            commands.append(command)
        if commands and commands[-1].plan.kind == "interaction":
            interacting = len(positions)
    way = np.array(positions)
    return Executed(
        way,
        interacting,
        _arrival_s(way, interacting) - watched.onset_s,
        dict(activation.counts),
        tuple(dict.fromkeys(refusals)),
    )


def ticks(watched: Watched, home_s: float = HOME_S) -> Iterator[Frame]:
    """Every 10 ms of the reach, and of some time to go home, in which the person rests."""
    frames = {frame.now_ns: frame for frame in watched.frames}
    first, last = watched.frames[0], watched.frames[-1]
    rests = np.eye(len(watched.labels))[-1]
    for now_ns in range(first.now_ns, last.now_ns + round(home_s * 1e9), STEP_NS):
        nothing = Frame(now_ns, rests if now_ns > last.now_ns else None, None, None)
        yield frames.get(now_ns, nothing)


def _arrival_s(way: NDArray[np.float64], interacting: int) -> float:
    """When the hand is where it will rest, before it goes home; infinite if it never left."""
    if not interacting:
        return np.inf
    hand = hand_position(way[:interacting])
    far = np.flatnonzero(np.linalg.norm(hand - hand[-1], axis=1) > ARRIVED_M)
    return (far[-1] + 1) * STEP_NS * 1e-9 if far.size else np.inf


def draw_boxes(rng: np.random.Generator, robot: "Robot", free: Executed) -> tuple[Box, ...]:
    """One or two boxes beside or in the way of the unguarded hand, clear of where it ends.

    Args:
        rng: draws them.
        robot: the arm.
        free: what it did without boxes.
    """
    hand = hand_position(free.positions[: free.interacting])
    ends = free.positions[[0, free.interacting - 1]]
    moved = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(hand, axis=0), axis=1)])
    boxes: list[Box] = []
    n = int(rng.integers(1, 3))
    while len(boxes) < n:
        at = hand[int(np.searchsorted(moved, rng.uniform(0.2, 0.8) * moved[-1]))]
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        size = rng.uniform(0.05, 0.2, 3)
        center = at + direction * (0.05 + size.max() / 2.0 + rng.uniform(-0.03, 0.12))
        turn = rng.uniform(-np.pi, np.pi) / 2.0
        quaternion = (0.0, 0.0, float(np.sin(turn)), float(np.cos(turn)))
        box = Box(f"box {len(boxes) + 1}", tuple(center), tuple(size), quaternion)
        bodies = Bodies(robot.description, robot.joint_names, [box], clearance_m=2 * CLEARANCE_M)
        if not any(bodies.contacts(ends[k : k + 1]) for k in range(2)):
            boxes.append(box)
    return tuple(boxes)


def nearest_m(
    robot: "Robot", boxes: Sequence[Box], ways: Sequence[NDArray[np.float64]]
) -> tuple[float, ...]:
    """The least distance from a box on each of some ways (T, 7), by PyBullet."""
    from sim_bridge.arm import BulletCell

    cell = BulletCell(robot, boxes)
    try:
        return tuple(min(min(cell.distances_m(q).values()) for q in way) for way in ways)
    finally:
        cell.close()

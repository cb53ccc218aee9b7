# SPDX-License-Identifier: Apache-2.0
"""Interactions executed in physics: activation, arm, boxes, and a person who may lead it.

What the nodes do, with one clock of 100 Hz: `lwr_sim`'s arm with its noisy sensors and its gripper
takes the trajectories that `primitive_activation` sends.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from experiments.reaches import STEP_NS, WatchedReach, ticks
from experiments.teaching.gripper import ToolboxGripper
from intent_recognition.activation import (
    Activation,
    ActivationSettings,
    Command,
    Mode,
    PredictedInteraction,
)
from intent_recognition.array_types import Floats
from intent_recognition.kinematics import JOINT_NAMES, Box, JointLimits
from intent_recognition.motion import Clearance, Correction, JointReference, TrackedMotion
from intent_recognition.promp import TaskLibrary
from intent_recognition.recognition import decision_settings
from intent_recognition.signals import Demonstration
from sim_bridge.arm import (
    STEPS_PER_SAMPLE,
    SensorNoise,
    SimulatedArm,
    Surroundings,
    TrajectoryCommand,
    TrajectoryFollower,
)
from sim_bridge.scenarios.toolbox import HOME

STEP_S = STEP_NS * 1e-9
GRIPPER_STEPS = 5
"""Physics steps between two decisions of the gripper, as in `arm_sim`."""
LONGEST_S = 12.0
"""Longest time for which an execution is watched after the reach [s]."""

SimulatedPerson = Callable[[SimulatedArm, Mode], None]
"""Called before each physics step; may push the arm."""


class Executed(NamedTuple):
    """An execution, every 10 ms until the arm sets out for home, or is there.

    Attributes:
        positions: measured (T, 7) [rad].
        references: reference in force at each sample.
        hand_m: where the hand was (T, 3), world.
        modes: mode of the activation at each sample.
        commands: in the order in which they were sent.
        corrected: the path followed in the end; None unless a person corrected it.
        counts: of the activation.
        refusals: its messages about motions that would touch, each once.
        touches: how often a link began to touch a box.
        touched: the two that touched last; empty if nothing did.
    """

    positions: Floats
    references: tuple[JointReference, ...]
    hand_m: Floats
    modes: tuple[Mode, ...]
    commands: tuple[Command, ...]
    corrected: PredictedInteraction | None
    counts: dict[str, int]
    refusals: tuple[str, ...]
    touches: int
    touched: tuple[str, str]

    @property
    def interacting(self) -> int:
        """Samples before the arm went home; 0 if it took no part."""
        if Mode.EXECUTING not in self.modes:
            return 0
        return self.modes.index(Mode.HOMING) if Mode.HOMING in self.modes else len(self.modes)

    @property
    def tracked(self) -> TrackedMotion:
        """The tracking error while the arm took part."""
        takes_part = [mode is Mode.EXECUTING for mode in self.modes]
        asked = [one for one, counts in zip(self.references, takes_part, strict=True) if counts]
        position, velocity, acceleration = (np.array(values) for values in zip(*asked, strict=True))
        return TrackedMotion(STEP_S, self.positions[takes_part] - position, velocity, acceleration)

    @property
    def largest_jump(self) -> tuple[float, float]:
        """Largest step of position [rad] and velocity [rad/s] where a command takes over."""
        pairs = zip(self.commands, self.commands[1:], strict=False)
        was_is = [(a.at(b.start_ns), b.at(b.start_ns)) for a, b in pairs]
        jumps = [[np.abs(a[k] - b[k]).max() for k in (0, 1)] for a, b in was_is]
        position, velocity = np.max(jumps, axis=0) if jumps else (0.0, 0.0)
        return float(position), float(velocity)


def execute(
    watched: WatchedReach,
    library: TaskLibrary,
    limits: JointLimits,
    correction: Correction | None,
    rng: np.random.Generator,
    person: SimulatedPerson | None = None,
    *,
    boxes: Sequence[Box] = (),
    clearance: Clearance | None = None,
    goes_home: bool = False,
) -> Executed:
    """Let the activation act on a reach with the arm in physics.

    Args:
        watched: the reach.
        library: its estimator's.
        limits: plans are held to them.
        correction: how pushes are detected; None ignores them.
        rng: of the arm's sensors.
        person: beside the arm; None: nobody.
        boxes: obstacles that stop the arm.
        clearance: what the activation knows of them; None: nothing.
        goes_home: whether the way home is executed as well.
    """
    refusals: list[str] = []

    def reject(reason: str, text: str) -> None:
        if reason == "would_touch":
            refusals.append(text)

    activation = Activation(
        ActivationSettings(
            limits=limits,
            decision=decision_settings(library),
            home=HOME,
            correction=correction,
            clearance=clearance,
        ),
        reject,
    )
    rows: list[tuple[Floats, JointReference, Floats, Mode]] = []
    commands: list[Command] = []
    corrected = None
    with SimulatedArm(HOME, noise=SensorNoise(), rng=rng) as arm:
        surroundings = Surroundings(arm, boxes)
        gripper = ToolboxGripper(arm)
        follower = TrajectoryFollower(arm.reference.position, arm.limits)

        def before_step(arm: SimulatedArm) -> None:
            arm.set_reference(*follower.sample(arm.time_s))
            if arm.n_steps % GRIPPER_STEPS == 0:
                gripper.update()
            if person is not None:
                person(arm, activation.mode)

        arm.before_step.append(before_step)
        for frame in ticks(watched, LONGEST_S):
            measured = arm.state()
            activation.take_joint_state(frame.now_ns, measured.q, measured.qd)
            if frame.probabilities is not None:
                activation.take_tasks(
                    frame.now_ns,
                    frame.now_ns,
                    watched.labels,
                    frame.probabilities,
                    frame.log_evidence,
                )
            if frame.prediction is not None:
                activation.take_prediction(frame.now_ns, frame.prediction)
            command = activation.step(frame.now_ns)
            ended = Mode.IDLE if goes_home else Mode.HOMING
            if commands and activation.mode is ended:
                break
            if command is not None:
                commands.append(command)
                follower.accept(_message(command, frame.now_ns, arm), arm.time_s)
            corrected = activation.motions.corrected or corrected
            gripper.set_task(activation.active_task)
            begun = (one for one in reversed(commands) if one.start_ns <= frame.now_ns)
            in_force = next(begun, None)
            asked = JointReference.at_rest(HOME) if in_force is None else in_force.at(frame.now_ns)
            rows.append((measured.q, asked, arm.hand_pose().position, activation.mode))
            arm.step(STEPS_PER_SAMPLE)
    positions, references, hand_m, modes = zip(*rows, strict=True)
    return Executed(
        np.array(positions),
        references,
        np.array(hand_m),
        modes,
        tuple(commands),
        corrected,
        dict(activation.counts),
        tuple(dict.fromkeys(refusals)),
        surroundings.touches,
        surroundings.last,
    )


def _message(command: Command, now_ns: int, arm: SimulatedArm) -> TrajectoryCommand:
    """The command as the arm takes it."""
    plan = command.plan
    return TrajectoryCommand.validated(
        JOINT_NAMES,
        plan.times_s,
        plan.positions,
        plan.velocities,
        start_s=arm.time_s + (command.start_ns - now_ns) * 1e-9,
        now_s=arm.time_s,
        limits=arm.limits,
        position=arm.state().q,
    )


def as_demonstration(
    watched: WatchedReach, followed: PredictedInteraction, library: TaskLibrary, name: str
) -> Demonstration:
    """The demonstration kept of a corrected execution: the person's movement and the path."""
    samples, first_ns = watched.samples, watched.frames[0].now_ns
    seen = samples.visible
    phases = (samples.times_s - (followed.onset_ns - first_ns) * 1e-9) / followed.path.duration_s
    return Demonstration.from_arrays(
        samples.times_s[seen],
        samples.positions_m[seen],
        followed.path.spline(np.clip(phases, 0.0, 1.0)),
        robot_times_s=samples.times_s,
        task=watched.task,
        observed_names=library.observed_names,
        controlled_names=library.controlled_names,
        name=name,
    )

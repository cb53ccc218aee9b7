# SPDX-License-Identifier: Apache-2.0
"""The arm in the second coworker's place: the predicted wrist path becomes the hand's, in physics.

The estimator and the activation are the nodes' own. Between them, closed-form inverse kinematics
turns the predicted positions of the assistant's wrist into joint angles, with the hand level and
pointing at the worker.
"""

from dataclasses import dataclass

import numpy as np

from experiments.recording import SAMPLE_NS
from intent_recognition.activation import (
    Activation,
    ActivationSettings,
    Command,
    PredictedInteraction,
)
from intent_recognition.array_types import Floats
from intent_recognition.errors import KinematicsError
from intent_recognition.kinematics import LWR_LIMITS, hand_position
from intent_recognition.motion import make_path, scaled_limits
from intent_recognition.promp import NONE, TaskLibrary, Trajectory
from intent_recognition.recognition import DecisionSettings, IntentEstimator, start_mean
from intent_recognition.signals import Demonstration, Observation, homogeneous, merge
from sim_bridge.arm import STEPS_PER_SAMPLE, SimulatedArm
from sim_bridge.scenarios.toolbox import arm_posture, hand_rotation

UPDATE_S = 0.08
"""Time between two plans with the newest prediction [s]."""
AFTER_S = 1.5
"""How long the worker holds still after the end of the recording [s]."""
LARGEST_END_STD_M = 0.1
"""Standard deviation of the predicted end above which the arm stays where it is [m]."""
N_POINTS = 41
"""Points of the predicted path from which a plan is made."""
HAND = hand_rotation(0.0, -0.25)
"""Orientation of the hand: level, pointing at the worker."""


@dataclass(frozen=True)
class StoodIn:
    """What the arm did during one recording; times are in seconds after the recording's start.

    Attributes:
        times_s: every 10 ms, (T,).
        hand_m: where the arm's hand was, (T, 3), world.
        asked_m: where the arm's reference had the hand, (T, 3).
        tasks: those that became active, in order; empty if none did.
        began_s: when the first command took over; NaN if none did.
        largest_torque: share of the torque limits used at the worst moment.
        again: whether a pause was taken for the movement's end, and the rest for another movement.
    """

    times_s: Floats
    hand_m: Floats
    asked_m: Floats
    tasks: tuple[str, ...]
    began_s: float
    largest_torque: float
    again: bool


def rest_position(library: TaskLibrary) -> Floats:
    """Where the assistant's wrist rests before any task, (3,): mean over the tasks."""
    return np.mean([start_mean(library, task) for task in range(library.n_tasks)], axis=0)


def hand_joints(positions_m: Floats) -> Floats:
    """Joint angles (T, 7) with the hand at positions (T, 3), level, on one branch.

    Raises:
        KinematicsError: a position is out of reach.
    """
    return np.array(list(map(arm_posture, homogeneous(HAND, positions_m))))


def stand_in(library: TaskLibrary, recording: Demonstration) -> StoodIn:
    """Let the arm take the assistant's place in one interaction while its recording plays.

    The estimator sees the worker's wrist, and the arm's hand in place of the assistant's. The arm
    starts where assistants rest. When the worker's movement is over, it ends its motion and begins
    no other one: a recording has one interaction.
    """
    observations = list(merge(recording.observed))
    start_ns = recording.start_ns
    end_ns = recording.end_ns + round(AFTER_S * 1e9)
    with SimulatedArm(hand_joints(rest_position(library)[None])[0]) as arm:
        run = _Run(library, arm, start_ns)
        observations += _held(observations[-1], end_ns)
        for now_ns in range(start_ns, end_ns, SAMPLE_NS):
            run.measure(now_ns)
            while observations and observations[0].stamp_ns <= now_ns:
                run.observe(observations.pop(0))
            run.act(now_ns)
        return run.outcome()


def _held(last: Observation, end_ns: int) -> list[Observation]:
    """The last observation, repeated every 10 ms until the end."""
    stamps = range(last.stamp_ns + SAMPLE_NS, end_ns, SAMPLE_NS)
    return [last._replace(stamp_ns=stamp) for stamp in stamps]


class _Run:
    """Estimator, activation and arm, step by step."""

    def __init__(self, library: TaskLibrary, arm: SimulatedArm, start_ns: int):
        settings = ActivationSettings(
            limits=scaled_limits(LWR_LIMITS),
            decision=DecisionSettings(max_end_std_m=LARGEST_END_STD_M),
            return_home=False,
        )
        self._limits, self._arm, self._start_ns = settings.limits, arm, start_ns
        self._labels = (*library.labels, NONE)
        self._estimator = IntentEstimator(library)
        self._activation = Activation(settings, lambda reason, text: None)
        self._commands: list[Command] = []
        self._rows: list[tuple[Floats, Floats]] = []
        self._planned_ns = 0
        self._tasks: list[str] = []
        self._largest_torque = 0.0
        self._over = self._again = False
        arm.before_step.append(self._follow)

    def measure(self, now_ns: int) -> None:
        """Take the arm's state; its hand stands for the assistant's wrist."""
        state = self._arm.state()
        share = float(np.max(np.abs(state.torque) / LWR_LIMITS.torque))
        self._largest_torque = max(self._largest_torque, share)
        hand = hand_position(state.q)
        self._estimator.update_controlled(Observation(now_ns, 0, hand))
        self._activation.take_joint_state(now_ns, state.q, state.qd)
        self._rows.append((hand, hand_position(self._arm.reference.position)))

    def observe(self, observation: Observation) -> None:
        """Update the estimate, and predict where a plan is due."""
        stamp_ns = observation.stamp_ns
        estimate = self._estimator.update(observation)
        due = stamp_ns - self._planned_ns >= UPDATE_S * 1e9
        due = due and not self._over
        predicted = self._estimator.predict_controlled(N_POINTS) if due else None
        if predicted is not None:
            self._planned_ns = stamp_ns
            prediction = self._prediction(predicted.task, predicted.onset_ns, predicted.trajectory)
            if prediction is not None:
                self._activation.take_prediction(stamp_ns, prediction)
        probabilities = estimate.probabilities
        if self._over:
            self._again |= estimate.moving
            probabilities = np.eye(len(self._labels))[-1]
        # Without log evidence `min_evidence` is not checked: the movement must be one of the tasks.
        self._activation.take_tasks(stamp_ns, stamp_ns, self._labels, probabilities)
        self._over |= self._activation.inbox.decision.event == "over"

    def _prediction(
        self, task: str, onset_ns: int, trajectory: Trajectory
    ) -> PredictedInteraction | None:
        """The predicted wrist path as a path of joints; None where the arm cannot reach."""
        try:
            joints = hand_joints(trajectory.positions)
            path = make_path(trajectory.times_s, joints, self._limits)
        except KinematicsError:
            return None
        end_std = {"m": float(np.max(trajectory.std[-1]))}
        return PredictedInteraction(task, onset_ns, path, end_std)

    def act(self, now_ns: int) -> None:
        """Plan, and move on by one sample."""
        command = self._activation.step(now_ns)
        if command is not None:
            self._commands.append(command)
        task = self._activation.active_task
        if task and task not in self._tasks[-1:]:
            self._tasks.append(task)
        self._arm.step(STEPS_PER_SAMPLE)

    def _follow(self, arm: SimulatedArm) -> None:
        """Set the reference of the command in force."""
        now_ns = self._start_ns + arm.n_steps * 1_000_000
        for command in reversed(self._commands[-2:]):
            if command.start_ns <= now_ns:
                arm.set_reference(*command.at(now_ns))
                return

    def outcome(self) -> StoodIn:
        """What the arm did."""
        hand, asked = (np.array(part) for part in zip(*self._rows, strict=True))
        began = [(command.start_ns - self._start_ns) * 1e-9 for command in self._commands]
        return StoodIn(
            np.arange(len(hand), dtype=np.float64) * 0.01,
            hand,
            asked,
            tuple(self._tasks),
            began[0] if began else float("nan"),
            self._largest_torque,
            self._again,
        )

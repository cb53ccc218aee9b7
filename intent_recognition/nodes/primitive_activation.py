# SPDX-License-Identifier: Apache-2.0
"""Node: turns recognised tasks and predicted trajectories into the arm's `joint_trajectory`."""

import math
import sys
import time
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.activation import Activation, Mode, PredictedInteraction
from intent_recognition.array_types import Floats
from intent_recognition.demonstrations import numbers_of
from intent_recognition.errors import ArgumentError, IntentError, MessageError
from intent_recognition.kinematics import Arm
from intent_recognition.motion import JointPath, hand_targets, is_hand
from intent_recognition.nodes import qos
from intent_recognition.nodes.activation_inputs import (
    ClearanceInput,
    PersonInput,
    TransferInput,
    load_detector,
    make_correction,
)
from intent_recognition.nodes.activation_output import ActivationOutput
from intent_recognition.nodes.activation_parameters import AT_REST, ActivationParameters
from intent_recognition.nodes.command_action import CommandAction
from intent_recognition.nodes.conversions import (
    joint_values,
    measured_values,
    of_other_joints,
    stamp_ns,
)
from intent_recognition.nodes.diagnostics import Diagnostics, RejectionError
from intent_recognition.nodes.hand_input import HandInput, no_description
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.parameters import (
    Changes,
    declare,
    keep_live,
    live_parameters,
    parameter_sources,
)
from intent_recognition.nodes.people import meet
from intent_recognition.nodes.prediction_input import joint_path, read_prediction
from intent_recognition.nodes.runtime import now_ns, run, steady_timer
from intent_recognition.nodes.sequence_runner import SequenceRunner
from intent_recognition.nodes.services import serve
from intent_recognition.promp import Trajectory

TASKS, PREDICTION = "intent/tasks", "intent/robot_trajectory"
"""Streams whose messages are counted together for all people."""
OF_ARM = "joint_states of the arm"
"""Stream of the messages on `joint_states` that are used: of the arm, not of a gripper alone."""
PLAYERS = "bag_player", "rosbag2_player"
"""Nodes that play recordings: the arm in a recording does not follow commands."""
SENDERS = {TASKS: "estimator or tracker", OF_ARM: "arm driver"}
"""Streams that never pause in normal operation, and who has failed if one does."""


class PrimitiveActivation(ManagedNode):
    """Passes messages to `activation.Activation`, and publishes its commands.

    Joint names come from the model file, or from the first acceptable trajectory when no model
    is given. All times are those of the node's clock, so that it works on simulated time.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("primitive_activation", **kwargs)
        self.diagnostics = Diagnostics(self)
        self._hand = HandInput(self, self.diagnostics)
        self._settings = ActivationParameters(self, self._hand)
        self._things = ClearanceInput(self, self.diagnostics)
        self._person = PersonInput(self, self._hand, self.diagnostics)
        detector = declare(self, "correction")["correction"]
        self._detector = load_detector(detector) if detector else None
        self._transfer = TransferInput(self.diagnostics)
        self._sequences = SequenceRunner(self, self.diagnostics)
        self.activation: Activation | None = None
        self.joint_names: tuple[str, ...] = ()
        action = self._settings.command_action
        self._action = (
            CommandAction(self, action, self.diagnostics, self._give_up) if action else None
        )
        self._output = ActivationOutput(self, self.diagnostics, self._action)
        hear = self.diagnostics.subscribe
        hear(JointState, "joint_states", self._on_joint_states, qos.MEASURED)
        if not meet(self, "intent/{}/tasks", self._meet):
            self._meet("")
            hear(JointState, "intent/next_task", self._on_next_task, qos.LATCHED)
        elif self.get_parameter("sequences").value:
            cure = "Leave one of the two empty: a sequence is of one person's work."
            raise ArgumentError.about("sequences", "none with persons", "both", cure)
        serve(self, "reset", self._reset)
        self._starts: dict[str, Floats] = {}
        self._taught_starts = self._starts
        self._starts_near = np.empty(0)
        keep_live(self, live_parameters("activation"), self._changed, self._change)
        self._silent, self._refused = "", False
        rate_hz = self._settings.rate_hz
        looks = math.ceil(25.0 / rate_hz)  # silence is noticed between rare updates, too
        self._timer = self.create_timer(1.0 / (rate_hz * looks), self._on_timer)
        steady_timer(self, 0.1, self._look_for_silence)
        self.start()

    def _meet(self, person: str) -> None:
        hear, prefix = self.diagnostics.subscribe, f"intent/{person}/" if person else "intent/"
        tasks, predicted = partial(self._on_tasks, person), partial(self._on_prediction, person)
        hear(JointState, f"{prefix}tasks", tasks, qos.STATE, TASKS)
        hear(JointTrajectory, f"{prefix}robot_trajectory", predicted, qos.COMMAND, PREDICTION)
        self._person.hear(person, f"{prefix}human_trajectory")

    # Lifecycle

    def configure(self) -> None:
        """Read the model, if one is named, and set the joints if they are known."""
        names, self._taught_starts = self._settings.read_model()
        library = self._settings.taught.library
        self._sequences.configure(library)
        if library is not None:
            self._person.know(library)
        self._hand.taught = self._settings.taught_link
        # Starts of a hand become postures once the arm is known, even if it was known before.
        self._starts = {} if self._settings.of_hand else self._taught_starts
        self._starts_near = np.empty(0)
        if names:
            self._apply_settings(names)
        self._output.model(self._settings)

    def activate(self) -> None:
        """Begin to act; only the command in force is kept from before."""
        if self.joint_names:
            self._apply_settings(self.joint_names)
        self._output.task(self.activation)

    def deactivate(self) -> None:
        """Brake the arm along its path and forget the interaction."""
        self._sequences.forget()
        self._output.task(self.activation)
        if self.activation is not None:
            self._halt(self.activation)

    def _halt(self, activation: Activation) -> None:
        self._output.command(activation.halt(now_ns(self)))
        self._tell_forgotten(activation)
        self._output.report(activation, self._silent)

    # Messages in

    def _on_tasks(self, person: str, message: JointState) -> None:
        activation = self.activation
        if not self.active or activation is None:
            return
        start_s = time.perf_counter()
        probabilities = np.array(message.position, dtype=np.float64)
        evidence = np.array(message.effort, dtype=np.float64) if message.effort else None
        with self.diagnostics.rejecting("bad_tasks"):
            activation.take_tasks(
                now_ns(self), stamp_ns(message), list(message.name), probabilities, evidence, person
            )
        self._step(activation, start_s)

    def _on_prediction(self, person: str, message: JointTrajectory) -> None:
        if not self.active:
            return
        start_s = time.perf_counter()
        prediction = self._accept_prediction(message)
        activation = self.activation
        if prediction is None or activation is None:
            return
        activation.take_prediction(now_ns(self), prediction, person)
        self._step(activation, start_s)

    def _accept_prediction(self, message: JointTrajectory) -> PredictedInteraction | None:
        """The prediction, or None if it is rejected; the first one determines the joints."""
        names = tuple(message.joint_names)
        try:
            joints = self._meet_arm().joint_names if is_hand(names) else names
            if self.joint_names and joints != self.joint_names:
                named, wanted = ", ".join(joints), ", ".join(self.joint_names)
                raise RejectionError("wrong_joint_names", f"{named} for {wanted}")
            read = read_prediction(message)
            if self.activation is None:
                self._limits = self._settings.settings(joints, self._starts).limits
            path = self._path(read.of_hand, read.times_s, read.positions, read.velocities)
            self._keep_clear(joints)
            if self.activation is None:
                self._apply_settings(joints)
        except IntentError as error:
            usual = "wrong_size" if isinstance(error, MessageError) else "bad_prediction"
            self.diagnostics.reject(getattr(error, "reason", usual), str(error))
            return None
        return PredictedInteraction(read.label, read.onset_ns, path, read.end_std)

    def _path(self, of_hand: bool, *numbers: Any) -> JointPath:
        hand_of = None
        if of_hand:
            arm = self._meet_arm()
            hand_of = arm, self._rest(arm)
        return joint_path(self._limits, *numbers, hand_of=hand_of)

    def _path_of(self, trajectory: Trajectory) -> JointPath:
        numbers = numbers_of(self._settings.entries, trajectory)
        return self._path(self._settings.of_hand, *numbers[:3])

    def _meet_arm(self) -> Arm:
        """The arm whose hand is predicted; a new arm or home gives new start postures of tasks."""
        arm = self._hand.arm
        if arm is None:
            raise RejectionError("no_robot_description", no_description("hand"))
        rest = self._rest(arm)
        if arm is not self._settings.described or not np.array_equal(rest, self._starts_near):
            self._settings.describe(arm)
            self._starts_near = rest
            self._starts = {
                label: arm.nearest(hand_targets(start), rest, rest).q
                for label, start in self._taught_starts.items()
            }
            if self.activation is not None and self.joint_names == arm.joint_names:
                self._apply_settings(self.joint_names)
        return arm

    def _keep_clear(self, names: tuple[str, ...]) -> None:
        """Update clearance and separation as soon as the arm's shape is known."""
        new = self._things.update(self._hand.description, names, self._settings.taught)
        new |= self._person.update(names)
        if new and self.activation is not None:
            self._apply_settings(self.joint_names)

    def _rest(self, arm: Arm) -> Floats:
        """Posture that the joints are drawn to: home if it is known, else the arm's own."""
        home = self._settings.home if self.activation is None else self.activation.home
        return arm.rest if home is None or len(home) != arm.n_joints else home

    def _on_joint_states(self, message: JointState) -> None:
        if of_other_joints(message, self.joint_names or message.name):
            return
        with self.diagnostics.rejecting("joint_states_incomplete"):
            if not self.active or self._uses(message):
                self.diagnostics.tick(OF_ARM)
        if self.active and self.diagnostics.answers and self.activation is not None:
            self._step(self.activation)  # simulated time waits for it, and for no timer

    def _uses(self, message: JointState) -> bool:
        """Use a measured state of the arm, if its joints are known; returns False if it is late.

        Raises:
            IntentError: it cannot be used.
        """
        if self.activation is None and self._settings.of_hand and self._hand.arm is not None:
            self._apply_settings(self._meet_arm().joint_names)
        if self.activation is None:
            return True
        position = joint_values(message, self.joint_names)
        velocity = measured_values(message, self.joint_names, "velocity")
        if velocity is not None and np.isnan(velocity).any():
            velocity = None  # at rest is then judged by positions
        measured = position if velocity is None else np.stack([position, velocity])
        if not np.all(np.isfinite(measured)):
            raise RejectionError("joint_states_not_finite", "joint_states holds NaN or infinity")
        if stamp_ns(message) == 0:
            raise RejectionError("joint_states_zero_stamp", "joint_states without a stamp")
        now = now_ns(self)
        return self.activation.take_joint_state(stamp_ns(message), position, velocity, now_ns=now)

    def _on_next_task(self, message: JointState) -> None:
        if not self.active or self.activation is None:
            return
        with self.diagnostics.rejecting("bad_next_task"):
            self.activation.take_next_task(
                now_ns(self), stamp_ns(message), list(message.name), np.array(message.position)
            )

    def _reset(self) -> str:
        self.check_active()
        if self.activation is not None:
            self._output.command(self.activation.reset(now_ns(self)))
            self._tell_forgotten(self.activation)
        return "interaction forgotten"

    def _give_up(self, reason: str) -> None:
        """Forget a command that the controller does not execute, and its interaction."""
        if self.activation is not None:
            self.activation.give_up(now_ns(self), reason)
            self._tell_forgotten(self.activation)
            self._output.status(self.activation, self._silent)

    def _tell_forgotten(self, activation: Activation) -> None:
        self._sequences.forget()
        self._output.outcomes(activation)
        self._output.task(activation)

    def _on_timer(self) -> None:
        if self.active and self.activation is not None and not self.diagnostics.answers:
            self._step(self.activation)

    # Silence

    def _look_for_silence(self) -> None:
        """Report at once, in real time, which streams have fallen silent or have resumed."""
        if self._action is not None:
            self._action.check()
        if self.active and self.joint_names:
            with suppress(IntentError):  # reported when it rejects a prediction
                self._keep_clear(self.joint_names)
        silent_s, senders = self.diagnostics.silent_s, SENDERS.items() if self.active else ()
        # a silent stream is reported within 1 s, including the time between two checks
        dead = [f"{name} ({who})" for name, who in senders if silent_s(name) > 0.6]
        silent = f"silent: {', '.join(dead)}" if dead else ""
        changed = self._output.look_for_others() or silent != self._silent
        if self.activation is not None:
            topic = self.resolve_topic_name("joint_states")
            drivers = {info.node_name for info in self.get_publishers_info_by_topic(topic)}
            self.activation.arm.obeys = drivers.isdisjoint(PLAYERS)
        refused = bool(self._output.shared) and not self._settings.allows_shared_arm
        if refused and not self._refused:
            self.diagnostics.reject("shared_arm", self._output.shared)
            if self.activation is not None:
                self._halt(self.activation)
        self._refused = refused
        if changed:
            self._silent = silent
            self._output.status(self.activation, self._silent)
            self.diagnostics.publish()

    # Steps

    def _step(self, activation: Activation, start_s: float | None = None) -> None:
        """Let the state machine act; the latency counts from the arrival of a message."""
        if self._refused:
            return
        activation.take_people(self._person.people)
        activation.take_exchange(self._transfer.exchanging_until_ns(now_ns(self)))
        self._sequences.update(activation, self._path_of, lambda: self._hand.arm)
        command = activation.step(now_ns(self))
        self._output.command(command)
        self._output.outcomes(activation)
        self._output.task(self.activation)
        self._output.report(activation, self._silent)
        if command is not None and start_s is not None:
            self.diagnostics.latency(time.perf_counter() - start_s)

    # Set-up

    def _changed(self, changes: Changes) -> ActivationParameters:
        settings = self._settings.changed(changes)
        of_motion = sorted(set(changes) & set(AT_REST))
        activation = self.activation
        if of_motion and activation is not None and activation.moves(now_ns(self)):
            mode = "braking" if activation.mode is Mode.IDLE else activation.mode.value
            cure = "Wait until it is home, or call ~/reset."
            raise ArgumentError.about(of_motion[0], "an arm at rest", mode, cure)
        if self.joint_names:
            settings.settings(self.joint_names, self._starts)
        return settings

    def _change(self, changes: Changes) -> None:
        self._settings = self._changed(changes)
        self._output.risk(self._settings.risk)
        if self.activation is not None:
            self._apply_settings(self.joint_names)

    def _apply_settings(self, names: tuple[str, ...]) -> None:
        """Set the joints; if they are the same as before, the command in force is kept."""
        settings = replace(
            self._settings.settings(names, self._starts),
            clearance=self._things.clearance,
            separation=self._person.separation,
            slow_places=self._person.slow_places,
            correction=make_correction(self._detector, names, self._settings.taught),
        )
        self._limits = settings.limits
        if self.activation is None or names != self.joint_names:
            self.activation = Activation(settings, self.diagnostics.reject)
            sources = parameter_sources(sys.argv, self.get_fully_qualified_name())
            in_force = self._settings.limits_in_force(names, sources)
            self.get_logger().info(f"limits in force: {in_force}")
        else:
            self.activation.change(settings)
        self.joint_names = names
        self._output.set_joints(names)


main = partial(run, PrimitiveActivation)

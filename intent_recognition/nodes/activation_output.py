# SPDX-License-Identifier: Apache-2.0
"""Outputs of `primitive_activation`: commands, active task, corrections, outcomes and status."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.activation import Activation, Command, Mode, PredictedInteraction
from intent_recognition.nodes import qos
from intent_recognition.nodes.activation_parameters import ActivationParameters
from intent_recognition.nodes.command_action import CommandAction
from intent_recognition.nodes.conversions import TrajectoryBuilder
from intent_recognition.nodes.diagnostics import Diagnostics, Level, key_values
from intent_recognition.nodes.people import named_people
from intent_recognition.promp import Risk
from intent_recognition.recognition import MAX_SWITCHED

_UNNAMED, _LOOKS = "_NODE_NAME_UNKNOWN_", 20
"""Name that ROS gives to a node which is not discovered yet, and number of looks after which such a
publisher counts as another node: 2 s, several times what the discovery of a node takes."""


class ActivationOutput:
    """Publishes commands, and the other outputs whenever they have changed.

    Without an action, the topic `joint_trajectory` takes the commands. `shared` is a text that
    names the other nodes that command the arm; empty if there are none.
    """

    def __init__(
        self, node: Node, diagnostics: Diagnostics, action: CommandAction | None = None
    ) -> None:
        self._logger, self._diagnostics, self._action = node.get_logger(), diagnostics, action
        self._node, self.shared = node, ""
        self._n_looks: dict[tuple[int, ...], int] = {}  # at publishers without a name
        self._command_topic = "joint_trajectory" if action is None else action.topic
        self._commands = action or node.create_publisher(
            JointTrajectory, "joint_trajectory", qos.COMMAND
        )
        self._task = node.create_publisher(String, "intent/active_task", qos.LATCHED)
        self._corrections = node.create_publisher(JointTrajectory, "intent/correction", qos.COMMAND)
        self._questions = node.create_publisher(JointState, "intent/question", qos.LATCHED)
        self._clock = node.get_clock()
        self._feedback = node.create_publisher(DiagnosticStatus, "intent/feedback", qos.FEEDBACK)
        self._builder: TrajectoryBuilder | None = None
        self._helped: Publisher | None = None
        if named_people(node):
            self._helped = node.create_publisher(String, "intent/active_person", qos.LATCHED)
        self._corrected: PredictedInteraction | None = None
        self._said: dict[str, object] = {"ahead": "", "question": set()}

    def set_joints(self, names: tuple[str, ...]) -> None:
        """Set the joints that commands are for."""
        self._builder = TrajectoryBuilder(names)

    def model(self, settings: ActivationParameters) -> None:
        """Report the risk of wrong actions, and tasks that the arm will never act on."""
        risk = settings.risk
        self.risk(risk)
        if risk is not None:
            few = risk.n_groups < risk.n_needed
            (self._logger.warning if few else self._logger.info)(str(risk))
        for task, std in settings.never_certain().items():
            self._diagnostics.value(f"never certain enough: {task} [rad]", f"{std:.2f}")
            self._logger.warning(
                f"{task} will not be acted on: its predicted end is never surer than {std:.2f} rad"
                " (standard deviation), and max_end_std asks for less. Teach it more"
                " consistently, or raise max_end_std where that is safe."
            )

    def risk(self, risk: Risk | None) -> None:
        """Report the bound on the share of wrong actions."""
        bound = "not known" if risk is None else f"{risk.bound:.3f}"
        self._diagnostics.value("wrong actions at most", bound)
        self._diagnostics.value("wrong switches at most", f"{MAX_SWITCHED:.3f}")

    def command(self, command: Command | None) -> None:
        """Send a command, if there is one."""
        if command is None or self._builder is None:
            return
        times_ns, positions, velocities = command.to_send()
        message = self._builder.build(
            int(times_ns[0]), (times_ns - times_ns[0]) * 1e-9, positions, velocities
        )
        self._commands.publish(message)
        self._diagnostics.tick("joint_trajectory")

    def look_for_others(self) -> bool:
        """Update `shared`; returns whether it changed. The dashboard of the namespace is exempt."""
        before, self.shared = self.shared, ""
        topic = self._node.resolve_topic_name(self._command_topic)
        there = self._node.get_publishers_info_by_topic(topic)
        unnamed = [tuple(info.endpoint_gid) for info in there if info.node_name == _UNNAMED]
        self._n_looks = {gid: self._n_looks.get(gid, 0) + 1 for gid in unnamed}
        names = [
            (info.node_name, info.node_namespace)
            for info in there
            if self._n_looks.get(tuple(info.endpoint_gid), _LOOKS) >= _LOOKS
        ]
        space = self._node.get_namespace()
        if (own := (self._node.get_name(), space)) in names:
            names.remove(own)
        page = "dashboard", space
        if others := sorted({f"{space}/{name}" for name, space in names if (name, space) != page}):
            who = " and ".join(other.replace("//", "/") for other in others)
            self.shared = f"shared arm: {who} publishes on {topic}, too"
        return self.shared != before

    def outcomes(self, activation: Activation) -> None:
        """Publish a person's correction of the motion, and the outcomes of interactions."""
        corrected = activation.motions.corrected
        if corrected is not None and corrected is not self._corrected and self._builder is not None:
            path, phases = corrected.path, np.linspace(0.0, 1.0, 61)
            positions, slopes = path.at(phases)
            times_s = phases * path.duration_s
            message = self._builder.build(
                corrected.onset_ns, times_s, positions, slopes / path.duration_s
            )
            message.header.frame_id = corrected.label
            self._corrections.publish(message)
        self._corrected = corrected
        while activation.outcomes:
            outcome = activation.outcomes.popleft()
            values = {"outcome": outcome.what, "corrections": str(outcome.n_corrections)}
            self._feedback.publish(DiagnosticStatus(name=outcome.label, values=key_values(values)))

    def task(self, activation: Activation | None) -> None:
        """Publish the helped person, the active task and those in question; log pretriggering."""
        person = "" if activation is None else activation.attended
        if self._helped is not None and self._is_news("person", person):
            self._helped.publish(String(data=person))
        task = "" if activation is None else activation.active_task
        if self._is_news("task", task):
            self._task.publish(String(data=task))
            self._diagnostics.tick("intent/active_task")
            self._logger.info(f"active task: {task or 'none'}")
        question = {} if activation is None else activation.inbox.question
        if self._is_news("question", {*question}):
            message = JointState(name=list(question), position=list(question.values()))
            message.header.stamp = self._clock.now().to_msg()
            self._questions.publish(message)
        ahead = "" if activation is None else activation.pretrigger.label
        if self._is_news("ahead", ahead):
            self._logger.info(f"pretriggered: {ahead}" if ahead else "no longer pretriggered")

    def _is_news(self, what: str, value: object) -> bool:
        before, self._said[what] = self._said.get(what), value
        return value != before

    def report(self, activation: Activation, silent: str) -> None:
        """Report to the diagnostics what the arm does."""
        value = self._diagnostics.value
        value("mode", activation.mode.value)
        value("active task", activation.active_task or "none")
        for name, count in activation.counts.items():
            value(f"count {name}", count)
        for name, text in activation.arm.clocks.items():
            value(name, text)
        value("expected task", activation.pretrigger.expected or "none")
        if activation.inbox.held_back:
            value("last held back", activation.inbox.held_back)
        if activation.people.reasons:
            value("asked for help", activation.people.reasons)
        value("waits for", activation.waits_for or "nothing")
        self.status(activation, silent)

    def status(self, activation: Activation | None, silent: str) -> None:
        """Set level and message of the diagnostics: what the arm does, and who is silent."""
        level, text = _status(activation)
        trouble = self.shared or (self._action.trouble if self._action else "")
        if trouble:
            level = Level.ERROR
        elif silent:
            level = Level.WARN
        self._diagnostics.status(level, "; ".join(filter(None, (text, silent, trouble))))


def _status(activation: Activation | None) -> tuple[int, str]:
    if activation is None:
        return Level.OK, "running"
    if activation.mode is Mode.STOPPED:
        return Level.WARN, f"stopped: {activation.stop_reason.replace('_', ' ')}"
    if activation.waits_for:
        return Level.WARN, f"waits: {activation.waits_for}"
    if activation.inbox.held_back:
        return Level.WARN, activation.inbox.held_back
    if activation.mode is Mode.PRETRIGGERED:
        return Level.OK, f"pretriggered: {activation.pretrigger.label}"
    return Level.OK, activation.mode.value

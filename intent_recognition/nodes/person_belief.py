# SPDX-License-Identifier: Apache-2.0
"""Input and output of one person's estimator: observations in, estimates and predictions out."""

from collections.abc import Callable, Hashable

from std_msgs.msg import String

from intent_recognition.demonstrations import DofSpec
from intent_recognition.errors import ArgumentError, one_line
from intent_recognition.model import Model, frames_of
from intent_recognition.nodes import qos
from intent_recognition.nodes.anticipation import NextTaskOutput, PostureInput
from intent_recognition.nodes.diagnostics import PATIENCE_S, Diagnostics, Level
from intent_recognition.nodes.frames import FrameOutput
from intent_recognition.nodes.intent_output import IntentOutput
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.observation_input import ObservationInput
from intent_recognition.nodes.runtime import LeftOvers, elapsed_s
from intent_recognition.parameter_table import parameter_parts
from intent_recognition.recognition import Estimate, IntentEstimator
from intent_recognition.signals import Observation
from intent_recognition.tracking import LOST_S

WAITING = Level.OK, "waiting for a movement"
"""Status of a person at rest."""


class PersonBelief:
    """Passes messages of one person to `recognition.IntentEstimator`, and publishes its estimates.

    A named person who was not seen for `tracking.LOST_S` is forgotten; a single person has no name.
    `on_change` is called when status or next task may have changed.
    """

    estimator: IntentEstimator

    def __init__(
        self,
        node: ManagedNode,
        diagnostics: Diagnostics,
        frames: FrameOutput,
        postures: PostureInput,
        on_change: Callable[["PersonBelief"], None],
        person: str = "",
    ) -> None:
        self._node, self._diagnostics, self._postures = node, diagnostics, postures
        self._on_change, self.person = on_change, person
        self.status, self.publish_rate = WAITING, 25.0
        self._newest_ns = 0
        topic = f"intent/{person}/" if person else "intent/"
        self._next_task = NextTaskOutput(node, f"{topic}next_task")
        self.output = IntentOutput(node, diagnostics, frames, person)
        node.create_subscription(String, f"{topic}answer", self._take_answer, qos.STATE)
        self.inputs = ObservationInput(
            node, diagnostics, self._observe, self._observe_context, person
        )
        self.left_overs = LeftOvers()

    def configure(self, model: Model, dofs: DofSpec, estimator: IntentEstimator) -> None:
        """Set the model, the DOFs to observe and the estimator."""
        self.estimator = estimator
        self.inputs.configure(dofs)
        self._use(model)
        self.output.configure(model)
        self._moving = self._silent = False
        self._last_arrival_s = 0.0
        self._last_publication_ns = 0

    def _use(self, model: Model) -> None:
        self._model = model
        self.inputs.learned_in(frames_of(model.library))

    def reload(self, model: Model) -> None:
        """Replace the model by another one of the same DOFs."""
        self.estimator.swap(model.library)
        self._use(model)
        self.output.swap(model)

    def tell_next(self) -> bool:
        """Publish the next task if it has changed; returns whether it has."""
        return self._next_task.update(self.estimator)

    def forget(self) -> None:
        """Forget the movement under way and those before it."""
        self.estimator.reset()
        self.output.forget()
        self._moving = self._silent = False
        self._last_publication_ns = 0
        self.status = WAITING
        self._on_change(self)

    def _say(self, level: Level, text: str) -> None:
        self.status = level, text
        self._on_change(self)

    def _take_answer(self, message: String) -> None:
        """Use a person's answer as evidence for the task, from the next observation on."""
        if not self._node.active:
            return
        with self._diagnostics.rejecting("bad_answer"):
            self.estimator.answer(message.data)

    def _observe(self, observation: Observation, topic: str) -> bool:
        stream = (observation.group, observation.derivative)
        if not self._accepts(stream, observation, topic, self.estimator.reason_to_reject):
            return False
        self._last_arrival_s = elapsed_s(self._node)
        stamp_ns, last_ns = observation.stamp_ns, self._newest_ns
        if self.person and abs(stamp_ns - last_ns) > LOST_S * 1e9:  # it may be somebody else
            self.forget()
        self._newest_ns = stamp_ns
        try:
            estimate = self.estimator.update(observation)
        except ArgumentError as error:  # numbers that are too large to compute with
            self._diagnostics.reject("not_finite", f"{topic}: {one_line(error)}")
            self.forget()
            return False
        self._publish(estimate, observation)
        return True

    def _observe_context(self, observation: Observation, topic: str) -> bool:
        stream = ("context", observation.group)
        return self._accepts(stream, observation, topic, self.estimator.update_context)

    def _accepts(
        self,
        stream: Hashable,
        observation: Observation,
        topic: str,
        reason_not_to: Callable[[Observation], str | None],
    ) -> bool:
        if self.left_overs.include(stream, observation.stamp_ns):
            self._diagnostics.count("left_over")
            return False
        reason = reason_not_to(observation)
        if reason is not None:
            misfit = self.estimator.first_samples.misfit if reason == "unit" else None
            detail = f"at {observation.stamp_ns} ns" if misfit is None else misfit.reason
            self._diagnostics.reject(reason, f"{topic}: {detail}")
            return False
        self.left_overs.last_ns[stream] = observation.stamp_ns
        return True

    def _publish(self, estimate: Estimate, observation: Observation) -> None:
        """Publish the prediction before the tasks: a decision also depends on its end."""
        if estimate.moving:
            self._publish_prediction(estimate, observation)
        self.output.publish_place(observation, rests=not estimate.moving)
        self.output.publish_tasks(estimate)
        if estimate.moving != self._moving or self._silent:
            self._moving, self._silent = estimate.moving, False
            self._say(Level.OK, "moving" if self._moving else WAITING[1])
        self._on_change(self)

    def _publish_prediction(self, estimate: Estimate, observation: Observation) -> None:
        self.output.observe(observation)
        since_s = abs(estimate.stamp_ns - self._last_publication_ns) * 1e-9
        if since_s < 0.999 / self.publish_rate:
            return
        self._last_publication_ns = estimate.stamp_ns
        robot = self.estimator.predict_controlled()
        if robot is not None:
            self._postures.note(robot, self.person)
            self.output.publish_robot(robot)
        if self.output.human_shown or self.output.human_wanted:
            human = self.estimator.predict_observed()
            if human is not None:
                self.output.publish_human(estimate, human, self.inputs.frame)

    def look(self) -> None:
        """Update the status if the person's stream is silent, or too sparse."""
        silent_s = elapsed_s(self._node) - self._last_arrival_s
        # by default the arm slows after this time
        slows_s = parameter_parts()["activation"]["timeout"].default
        if self._moving and silent_s > slows_s:
            self._silent = True
            self._say(Level.WARN, f"human stream stopped {silent_s:.1f} s ago")
        elif not self._moving:
            sparse = self.estimator.too_sparse()
            if sparse is None or silent_s > PATIENCE_S:
                self._say(*WAITING)
            else:
                topic = self._model.dofs.observed[sparse.group].topic
                self._say(Level.WARN, sparse.warning(topic))

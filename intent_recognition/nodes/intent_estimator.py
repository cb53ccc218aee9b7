# SPDX-License-Identifier: Apache-2.0
"""Node: recognises the human's task and predicts both agents from `human/<body>`."""

import pathlib
from collections.abc import Callable, Hashable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from std_msgs.msg import String

from intent_recognition.demonstrations import DofSpec, load_dofs
from intent_recognition.errors import ArgumentError, IntentError, one_line
from intent_recognition.model import Model, check_dofs, frames_of, load_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.anticipation import NextTaskOutput, PostureInput
from intent_recognition.nodes.diagnostics import MODEL, Diagnostics, Level, values_of
from intent_recognition.nodes.intent_output import IntentOutput
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.observation_input import ObservationInput
from intent_recognition.nodes.parameters import Changes, declare, keep_live
from intent_recognition.nodes.plan_follower import PLAN, PlanFollower
from intent_recognition.nodes.runtime import (
    LeftOvers,
    elapsed_s,
    run,
    steady_timer,
    when_clock_goes_back,
)
from intent_recognition.nodes.services import serve
from intent_recognition.nodes.via_points import VIA_POINTS, ViaPointInput
from intent_recognition.recognition import Estimate, IntentEstimator
from intent_recognition.signals import Observation

STREAM_TIMEOUT_S = 0.5
"""Silence of the observed agent during a movement that is reported [s]; the default `timeout` of
`primitive_activation` (contract)."""
CHECK_PERIOD_S = 0.1
"""Time between two looks at the stream [s]. Convention."""
LIVE = ("publish_rate", "transition_prior", "forget_after", VIA_POINTS, PLAN)


class IntentEstimatorNode(ManagedNode):
    """Translates messages to `recognition.IntentEstimator` and its estimates to messages."""

    _model: Model
    _estimator: IntentEstimator
    """Both from `configure` on."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("intent_estimator", **kwargs)
        values = declare(self, "intent_estimator")
        self._dofs_path = values["dofs"]
        self._own_dofs: DofSpec | None = None
        self._configured, self._step = False, ""
        self._publish_rate = values["publish_rate"]
        self._start_posture = values["start_posture"]
        self._switching = values["switching"]
        self._transitions = values["transition_prior"]
        self._forget_after_s = values["forget_after"]
        self._diagnostics = Diagnostics(self)
        self._postures = PostureInput(self, self._diagnostics)
        self._via_points = ViaPointInput(self, self._diagnostics)
        self._plan = PlanFollower(self, self._diagnostics)
        keep_live(self, LIVE, self._check, self._change)
        self._next_task = NextTaskOutput(self)
        self._output = IntentOutput(self, self._diagnostics)
        serve(self, "reset", self._reset)
        serve(self, "reload_model", self._reload)
        self.create_subscription(
            DiagnosticStatus, "intent/sequence", self._take_sequence, qos.LATCHED
        )
        self._answers = self.create_subscription(
            String, "intent/answer", self._take_answer, qos.STATE
        )
        self._inputs = ObservationInput(
            self, self._diagnostics, self._observe, self._observe_context
        )
        self._watchdog = steady_timer(self, CHECK_PERIOD_S, self._check_stream)
        self._last_ns: dict[Hashable, int] = {}
        self._left_overs = LeftOvers({})
        when_clock_goes_back(self, self._start_over)
        self.start()

    def _take_answer(self, message: String) -> None:
        """Count what a person says the movement is as evidence, from the next observation on."""
        if not self.active:
            return
        try:
            self._estimator.answer(message.data)
        except IntentError as error:
            self._diagnostics.reject("bad_answer", str(error))

    def _start_over(self) -> None:
        """Forget the movement and what came before: what comes next is earlier."""
        self._left_overs, self._last_ns = LeftOvers(self._last_ns), {}
        self._postures.start_over()
        if self.active:
            self._forget()

    def _check(self, changes: Changes) -> None:
        """Make sure that new values can be taken; see `ViaPointInput.check`."""
        if VIA_POINTS in changes:
            estimator = self._estimator if self._configured else None
            self._via_points.check(changes[VIA_POINTS], estimator, self._postures.arm)
        if PLAN in changes:
            self._plan.check(changes[PLAN], self._estimator if self._configured else None)

    def _change(self, changes: Changes) -> None:
        """Apply new values of parameters."""
        if VIA_POINTS in changes:
            self._via_points.change(changes[VIA_POINTS])
            if self._configured:
                self._via_points.use(self._estimator, self._postures.arm)
        if PLAN in changes:
            self._plan.change(changes[PLAN])
            if self._configured:
                self._plan.follow(self._estimator)
        self._publish_rate = changes.get("publish_rate", self._publish_rate)
        self._transitions = changes.get("transition_prior", self._transitions)
        self._forget_after_s = changes.get("forget_after", self._forget_after_s)
        if not self._configured or set(changes) <= {"publish_rate", VIA_POINTS}:
            return
        self._estimator.expectation.change(self._transitions, self._forget_after_s)
        if self.active:
            self._tell_next()

    def configure(self) -> None:
        """Load the model and check it against the DOF file."""
        self._model = self._load()
        self._inputs.configure(self._own_dofs or self._model.dofs)
        self._inputs.learned_in(frames_of(self._model.library))
        self._estimator = IntentEstimator(
            self._model.library,
            transitions=self._transitions,
            forget_after_s=self._forget_after_s,
            start_posture=self._start_posture,
            switching=self._switching,
        )
        self._plan.follow(self._estimator)
        self._estimator.expect(self._step)
        self._output.configure(self._model)
        self._moving = self._silent = False
        self._last_arrival_s = 0.0
        self._last_publication_ns = 0
        self._configured = True
        self._diagnostics.value(MODEL, self.get_parameter("model").value)
        self.get_logger().info(self._told_tasks())

    def activate(self) -> None:
        """Subscribe to the observed agent."""
        self._inputs.open()
        if self._start_posture:
            controlled = self._model.dofs.controlled
            self._postures.open(self._estimator, controlled)
        self._tell_next()
        self._diagnostics.status(Level.OK, "waiting for a movement")

    def deactivate(self) -> None:
        """Unsubscribe and discard the movement under way."""
        self._inputs.close()
        self._postures.close()
        self._forget()
        self._diagnostics.status(Level.OK, "not active")

    def _tell_next(self) -> None:
        """Publish what may come next, if that has changed."""
        if self._next_task.update(self._estimator):
            self._plan.update(self._estimator)

    def _forget(self) -> None:
        self._estimator.reset()
        self._tell_next()
        self._output.forget()
        self._moving = self._silent = False
        self._last_publication_ns = 0

    def _load(self) -> Model:
        path = self.get_parameter("model").value
        if not path:
            raise ArgumentError.about(
                "parameter model",
                "a model file",
                "nothing",
                "Train one with `intent train BAG... --output M.npz` and pass -p model:=M.npz.",
            )
        model = load_model(path)
        if self._dofs_path:
            self._own_dofs = check_dofs(model, load_dofs(self._dofs_path), self._dofs_path)
        return model

    def _take_sequence(self, message: DiagnosticStatus) -> None:
        """Expect the step that a sequence is at."""
        self._step = values_of(message).get("task", "")
        if self._configured:
            self._estimator.expect(self._step)

    def _observe(self, observation: Observation, topic: str) -> bool:
        """Take an observation; False if it cannot be used."""
        stream = (observation.group, observation.derivative)
        if not self._accepts(stream, observation, topic, self._estimator.reason_to_reject):
            return False
        self._last_arrival_s = elapsed_s(self)
        try:
            estimate = self._estimator.update(observation)
        except ArgumentError as error:  # numbers so large that nothing can be computed of them
            self._diagnostics.reject("not_finite", f"{topic}: {one_line(error)}")
            self._forget()
            return False
        self._publish(estimate, observation)
        return True

    def _observe_context(self, observation: Observation, topic: str) -> bool:
        """Take a sample of the scene; False if it cannot be used."""
        stream = ("context", observation.group)
        return self._accepts(stream, observation, topic, self._estimator.update_context)

    def _accepts(
        self,
        stream: Hashable,
        observation: Observation,
        topic: str,
        reason_not_to: Callable[[Observation], str | None],
    ) -> bool:
        """Whether an observation can be used; if not, it is counted."""
        if self._left_overs.include(stream, observation.stamp_ns):
            self._diagnostics.count("left_over")
            return False
        reason = reason_not_to(observation)
        if reason is not None:
            misfit = self._estimator.first_samples.misfit if reason == "unit" else None
            detail = f"at {observation.stamp_ns} ns" if misfit is None else misfit.reason
            self._diagnostics.reject(reason, f"{topic}: {detail}")
            return False
        self._last_ns[stream] = observation.stamp_ns
        return True

    def _publish(self, estimate: Estimate, observation: Observation) -> None:
        """Publish the prediction before the tasks: who decides on them needs its certain end."""
        if estimate.moving:
            self._publish_prediction(estimate, observation)
        self._output.publish_tasks(estimate)
        if estimate.moving != self._moving or self._silent:
            self._moving, self._silent = estimate.moving, False
            self._diagnostics.status(
                Level.OK, "moving" if self._moving else "waiting for a movement"
            )
        self._tell_next()

    def _publish_prediction(self, estimate: Estimate, observation: Observation) -> None:
        self._output.observe(observation)
        since_s = abs(estimate.stamp_ns - self._last_publication_ns) * 1e-9
        if since_s < 0.999 / self._publish_rate:
            return
        self._last_publication_ns = estimate.stamp_ns
        robot = self._estimator.predict_controlled()
        if robot is not None:
            self._postures.note(robot)
            self._output.publish_robot(robot)
        if self._output.human_shown or self._output.human_told:
            human = self._estimator.predict_observed()
            if human is not None:
                self._output.publish_human(estimate, human, self._inputs.frame)

    def _check_stream(self) -> None:
        if not self.active:
            return
        self._via_points.use(self._estimator, self._postures.arm)
        silent_s = elapsed_s(self) - self._last_arrival_s
        if self._moving and silent_s > STREAM_TIMEOUT_S:
            self._silent = True
            self._diagnostics.status(Level.WARN, f"human stream stopped {silent_s:.1f} s ago")
        elif not self._moving:
            sparse = self._estimator.too_sparse()
            if sparse is None:
                self._diagnostics.status(Level.OK, "waiting for a movement")
            else:
                topic = self._model.dofs.observed[sparse.group].topic
                self._diagnostics.status(Level.WARN, sparse.told(topic))

    def _reset(self) -> str:
        self.check_active()
        self._forget()
        self._diagnostics.status(Level.OK, "waiting for a movement")
        return "reset"

    def _reload(self) -> str:
        try:
            self.check_active()
            model = self._load()
            check_dofs(self._model, model.dofs, str(self.get_parameter("model").value))
            self._estimator.swap(model.library)
        except IntentError as error:
            self.get_logger().error(f"reload_model: {error}")
            raise
        self._model = model
        self._inputs.learned_in(frames_of(model.library))
        self._output.swap(model)
        self._tell_next()
        self._diagnostics.value(MODEL, self.get_parameter("model").value)
        self.get_logger().info(f"model changed; {self._told_tasks()}")
        return self._told_tasks()

    def _told_tasks(self) -> str:
        path = pathlib.Path(str(self.get_parameter("model").value)).absolute()
        return f"tasks: {', '.join(self._model.labels)} ({path})"


main = partial(run, IntentEstimatorNode)

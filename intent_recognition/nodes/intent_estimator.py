# SPDX-License-Identifier: Apache-2.0
"""Node: recognises the human's task and predicts both agents from `human/<body>`."""

import pathlib
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from intent_recognition.demonstrations import DofSpec, is_raw_pose, load_dofs
from intent_recognition.errors import ArgumentError, IntentError
from intent_recognition.model import Model, check_dofs, load_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.anticipation import PostureInput
from intent_recognition.nodes.diagnostics import MODEL, Diagnostics, Level, values_of
from intent_recognition.nodes.frames import FrameOutput
from intent_recognition.nodes.lifecycle import ManagedNode
from intent_recognition.nodes.observation_input import human_topic
from intent_recognition.nodes.parameters import Changes, declare, keep_live
from intent_recognition.nodes.people import ANYBODY, meet, named_people
from intent_recognition.nodes.person_belief import WAITING, PersonBelief
from intent_recognition.nodes.plan_follower import PLAN, PlanFollower
from intent_recognition.nodes.runtime import run, steady_timer, when_clock_goes_back
from intent_recognition.nodes.services import serve
from intent_recognition.nodes.via_points import VIA_POINTS, ViaPointInput
from intent_recognition.recognition import IntentEstimator

LIVE = ("publish_rate", "transition_prior", "forget_after", VIA_POINTS, PLAN)


class IntentEstimatorNode(ManagedNode):
    """Keeps one `PersonBelief` per person, all with the same model."""

    _model: Model
    """Set by `configure`."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("intent_estimator", **kwargs)
        self._values = declare(self, "intent_estimator")
        self._own_dofs: DofSpec | None = None
        self._configured, self._meets, self._step = False, False, ""
        self._diagnostics = Diagnostics(self)
        self._postures = PostureInput(self, self._diagnostics)
        self._via_points = ViaPointInput(self, self._diagnostics)
        self._plan = PlanFollower(self, self._diagnostics)
        keep_live(self, LIVE, self._check, self._change)
        self._frames = FrameOutput(self)
        self.people: dict[str, PersonBelief] = {}
        self._statuses: dict[str, tuple[Level, str]] = {}
        serve(self, "reset", self._reset)
        serve(self, "reload_model", self._reload)
        self.create_subscription(
            DiagnosticStatus, "intent/sequence", self._take_sequence, qos.LATCHED
        )
        steady_timer(self, 0.1, self._check_stream)
        when_clock_goes_back(self, self._start_over)
        for person in named_people(self) or [""]:
            if person != ANYBODY:
                self._meet(person)
        self.start()

    def _start_over(self) -> None:
        self._postures.left_overs.start_over()
        for belief in self.people.values():
            belief.left_overs.start_over()
        if self.active:
            self._forget()

    @property
    def _estimators(self) -> tuple[IntentEstimator, ...]:
        return tuple(b.estimator for b in self.people.values()) if self._configured else ()

    def _meet(self, person: str) -> None:
        if person in self.people:
            return
        self.people[person] = belief = PersonBelief(
            self, self._diagnostics, self._frames, self._postures, self._publish, person
        )
        belief.publish_rate = self._values["publish_rate"]
        if self._configured:
            self._configure(belief)
        if self.active:
            belief.inputs.open()
            self._postures.estimators = self._estimators

    def _check(self, changes: Changes) -> None:
        """Refuse new values that cannot be used; see `ViaPointInput.check`."""
        if VIA_POINTS in changes:
            self._via_points.check(changes[VIA_POINTS], self._estimators, self._postures.hand.arm)
        if PLAN in changes:
            self._plan.check(changes[PLAN], self._estimators)

    def _change(self, changes: Changes) -> None:
        if VIA_POINTS in changes:
            self._via_points.change(changes[VIA_POINTS])
            self._via_points.use(self._estimators, self._postures.hand.arm)
        if PLAN in changes:
            self._plan.change(changes[PLAN])
            for estimator in self._estimators:
                self._plan.follow(estimator)
        self._values |= changes
        for belief in self.people.values():
            belief.publish_rate = self._values["publish_rate"]
        if not self._configured or set(changes) <= {"publish_rate", VIA_POINTS}:
            return
        for belief in self.people.values():
            belief.estimator.expectation.change(
                self._values["transition_prior"], self._values["forget_after"]
            )
            if self.active:
                self._publish(belief)

    def configure(self) -> None:
        """Load the model and check it against the DOF file."""
        self._model = self._load()
        for belief in self.people.values():
            self._configure(belief)
        self._configured = True
        self._report_model()

    def _topic_of(self, person: str) -> str:
        for entry in self._model.dofs.observed:
            if is_raw_pose(entry.topic, entry.type):
                return human_topic(entry, person)
        cure = "Leave persons empty."
        raise ArgumentError.about("parameter persons", "a model of poses", "none", cure)

    def _configure(self, belief: PersonBelief) -> None:
        estimator = IntentEstimator(
            self._model.library,
            transitions=self._values["transition_prior"],
            forget_after_s=self._values["forget_after"],
            start_posture=self._values["start_posture"],
            switching=self._values["switching"],
        )
        self._plan.follow(estimator)
        estimator.expect(self._step)
        belief.configure(self._model, self._own_dofs or self._model.dofs, estimator)

    def activate(self) -> None:
        """Subscribe to the observed agents."""
        for belief in self.people.values():
            belief.inputs.open()
        if self._values["start_posture"]:
            self._postures.open(self._estimators, self._model.dofs.controlled)
        if not self._meets and "" not in self.people:
            self._meets = meet(self, self._topic_of("{}"), self._meet)
        for belief in self.people.values():
            self._publish(belief)
        self._diagnostics.status(*WAITING)

    def deactivate(self) -> None:
        """Unsubscribe and discard the movements under way."""
        for belief in self.people.values():
            belief.inputs.close()
        self._postures.close()
        self._forget()
        self._diagnostics.status(Level.OK, "not active")

    def _publish(self, belief: PersonBelief) -> None:
        """Publish the next task, and report all people's states and the worst level, if changed."""
        if belief.tell_next():
            self._plan.share(self._estimators)
            for other in self.people.values():
                other.tell_next()
            self._plan.update(belief.estimator)
        if belief.status != self._statuses.get(belief.person):
            self._statuses[belief.person] = belief.status
            texts = (f"{who}: {text}" if who else text for who, (_, text) in self._statuses.items())
            level = max(level for level, _ in self._statuses.values())
            self._diagnostics.status(level, "; ".join(texts))

    def _forget(self) -> None:
        for estimator in self._estimators:  # reset all before one shares its progress with others
            estimator.reset()
        for belief in self.people.values():
            belief.forget()

    def _load(self) -> Model:
        path = self.get_parameter("model").value
        if not path:
            cure = "Train one with `intent train BAG... --output M.npz` and pass -p model:=M.npz."
            raise ArgumentError.about("parameter model", "a model file", "nothing", cure)
        model = load_model(path)
        if dofs := self._values["dofs"]:
            self._own_dofs = check_dofs(model, load_dofs(dofs), dofs)
        return model

    def _take_sequence(self, message: DiagnosticStatus) -> None:
        self._step = values_of(message).get("task", "")
        for estimator in self._estimators:
            estimator.expect(self._step)

    def _check_stream(self) -> None:
        if not self.active:
            return
        self._via_points.use(self._estimators, self._postures.hand.arm)
        for belief in self.people.values():
            belief.look()

    def _reset(self) -> str:
        self.check_active()
        self._forget()
        self._diagnostics.status(*WAITING)
        return "reset"

    def _reload(self) -> str:
        try:
            self.check_active()
            model = self._load()
            check_dofs(self._model, model.dofs, str(self.get_parameter("model").value))
            for belief in self.people.values():
                belief.reload(model)
        except IntentError as error:
            self.get_logger().error(f"reload_model: {error}")
            raise
        self._model = model
        for belief in self.people.values():
            self._publish(belief)
        return self._report_model("model changed; ")

    def _report_model(self, what: str = "") -> str:
        """Name the model and its tasks in the diagnostics and in the log; returns the tasks."""
        path = self.get_parameter("model").value
        self._diagnostics.value(MODEL, path)
        text = f"tasks: {', '.join(self._model.labels)} ({pathlib.Path(path).absolute()})"
        self.get_logger().info(what + text)
        return text


main = partial(run, IntentEstimatorNode)

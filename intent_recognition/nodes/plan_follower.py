# SPDX-License-Identifier: Apache-2.0
"""The plan of an assembly in the estimator node: parameter in, progress out."""

from collections.abc import Sequence
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

from intent_recognition.durable import write_text
from intent_recognition.errors import ArgumentError
from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import Diagnostics, key_values
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.services import serve
from intent_recognition.plans import WorkPlan, WorkProgress, read_plan, write_plan
from intent_recognition.recognition import IntentEstimator
from intent_recognition.untrusted import read_named

PLAN = "plan"


class PlanFollower:
    """Takes the parameter `plan`, and publishes the progress of the assembly on `intent/plan`.

    Several people work on one assembly: a step that one of them has done counts for all. The
    service `save_plan` writes the plan in force to the file that the parameter named last.

    `intent/plan` is a diagnostic_msgs/DiagnosticStatus: `message` names the steps that were
    forgotten, may come, or have a task that the model lacks, and `values` hold for each other step
    "done", "may come", "forgotten" or "later" with its probability of being done, and the plan
    itself as `yaml`.
    """

    def __init__(self, node: Node, diagnostics: Diagnostics):
        self._diagnostics = diagnostics
        self._file, self._n_taken = "", 0
        self.change(declare(node, PLAN)[PLAN])
        serve(node, "save_plan", self._save)
        self._publisher = node.create_publisher(DiagnosticStatus, "intent/plan", qos.LATCHED)
        self._published: DiagnosticStatus | None = None

    def check(self, text: str, estimators: Sequence[IntentEstimator]) -> None:
        """Refuse a value of the parameter that cannot be used."""
        plan = _read(text)
        if plan is not None and estimators:
            WorkProgress(plan, estimators[0].library.labels)

    def change(self, text: str) -> None:
        """Set a value that was checked; `follow` puts it in force."""
        self._plan = _read(text)
        self._file = self._file if "\n" in text else text

    def _save(self) -> str:
        if self._plan is None or not self._file:
            cure = "Start with `plan:=FILE`."
            raise ArgumentError.about(PLAN, "a plan from a file", "none", cure)
        try:
            write_text(Path(self._file), write_plan(self._plan))
        except OSError as error:
            raise ArgumentError.about(PLAN, "a file to write", error, "Name another.") from error
        return f"saved the plan in {self._file}"

    def follow(self, estimator: IntentEstimator) -> None:
        """Let an estimator follow the plan; steps that were done stay done."""
        estimator.expectation.follow(self._plan)

    def share(self, everybody: Sequence[IntentEstimator]) -> None:
        """Give all people's estimators the furthest progress, also those that were reset."""
        followed = [one.expectation.progress for one in everybody]
        found = [progress for progress in followed if progress is not None]
        if len(found) < 2:
            return
        furthest = max(found, key=lambda progress: progress.n_taken)
        news, self._n_taken = furthest.n_taken != self._n_taken, furthest.n_taken
        for one in everybody:
            if news or one.expectation.progress is not furthest:
                one.share(furthest)

    def update(self, estimator: IntentEstimator) -> None:
        """Publish the progress of the assembly, if it has changed."""
        progress = estimator.expectation.progress
        message = DiagnosticStatus(name=PLAN, message="no plan")
        if progress is not None and self._plan is not None:
            steps = progress.steps()
            states = [(str(step), step.name) for step in steps]
            unknown = [one for one in self._plan.steps if one.task not in ("", *progress.labels)]
            states += [("not learned", f"{one.name} ({one.task})") for one in unknown]
            parts = [
                f"{what}: {', '.join(names)}"
                for what in ("forgotten", "may come", "not learned")
                if (names := [name for state, name in states if state == what])
            ]
            message.message = "; ".join(parts) or "done"
            if any(str(step) == "forgotten" for step in steps):
                message.level = DiagnosticStatus.WARN
            rows = {step.name: f"{step} {step.done:.2f}" for step in steps}
            message.values = key_values({**rows, "yaml": write_plan(self._plan)})
        if message == self._published or (self._published is None and progress is None):
            return
        self._published = message
        self._publisher.publish(message)
        self._diagnostics.value("plan", message.message)


def _read(text: str) -> WorkPlan | None:
    if not text:
        return None
    if "\n" in text:
        return read_plan(text)
    cure = "Name a file of `intent plan learn`, or give its YAML."
    return read_named(Path(text), PLAN, cure, read_plan)

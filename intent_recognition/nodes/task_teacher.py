# SPDX-License-Identifier: Apache-2.0
"""Node: records demonstrations while the graph runs and learns them for the estimator."""

import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.bags import RawMessage
from intent_recognition.demonstrations import HAND_LINK, topics_of
from intent_recognition.errors import ArgumentError, BagError, IntentError, ResourceBusyError
from intent_recognition.model import (
    PRACTICE,
    SKILL_COLUMNS,
    THUMBS,
    TO_KEEP,
    TO_UNDO,
    WAIT,
    WAITING,
    Change,
    Executions,
    TaskFolder,
    is_task_folder,
    library_dofs,
    load_trained,
    now,
    skill_history,
    undoable,
)
from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import MODEL, Level, key_values, values_of
from intent_recognition.nodes.execution_recorder import ExecutionRecorder
from intent_recognition.nodes.parameters import declare
from intent_recognition.nodes.runtime import ANSWER_S, now_ns, run, steady_timer
from intent_recognition.nodes.services import answer, serve
from intent_recognition.nodes.task_practice import TaskPracticeService
from intent_recognition.nodes.topic_recorder import TopicRecorder
from intent_recognition.registry import LEARNING


class TaskTeacher(TopicRecorder):
    """A recorder whose recordings become tasks.

    If `executions` is above 0, executions are recorded, too, with the messages about them on
    `intent/feedback`. Each service calls the method of its name; `~/practise` (true begins) and
    `~/accept` call those of `task_practice`. Each event is reported in a sentence on
    `teach/status`, where the last one is latched.

    An estimator that had the library's model, but was restarted with another one, gets it again.

    Attributes:
        waiting: recordings that are not learned yet.
        sending_model: whether a model is on its way to the estimator.
        loaded: model that the estimator reported last; None before its first report.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("task_teacher", **kwargs)
        self.last_status = ""
        self.sending_model = False
        self.loaded: str | None = None
        self._asked_why, self._asked_s = "", 0.0
        self._in_use = False
        values = declare(self, "task_teacher")
        self.folder = self._open_folder(values)
        self.waiting: list[Path] = self.folder.waiting()
        self.executions = ExecutionRecorder(
            Executions(self.folder.path, now),
            values["executions"],
            self.folder.present_model,
            self.diagnostics.reject,
        )
        declare(self, "practice")
        self.practice = TaskPracticeService(self)
        steady_timer(self, 0.1, self.practice.step)
        self._status = self.create_publisher(String, "teach/status", qos.LATCHED)
        self._skills = self.create_publisher(DiagnosticArray, "teach/skills", qos.LATCHED)
        for name in LEARNING:
            serve(self, name, getattr(self, name))
        serve(self, "accept", self.practice.accept)
        self.create_service(SetBool, "~/practise", self._practise)
        estimator = "intent_estimator"
        self._set_model = self.create_client(SetParameters, f"{estimator}/set_parameters")
        self._reload = self.create_client(Trigger, f"{estimator}/reload_model")
        self._estimator_name = self.resolve_topic_name(estimator).lstrip("/")
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_reports, 10)
        self._hand_link = values["hand_link"]
        self.create_subscription(String, "intent/active_task", self._on_active, qos.LATCHED)
        self.create_subscription(
            DiagnosticStatus, "intent/feedback", self._on_feedback, qos.FEEDBACK
        )
        self.create_subscription(
            JointTrajectory, "intent/correction", self._on_correction, qos.COMMAND, raw=True
        )
        self.listen(topics_of(self.folder.dofs))
        self._publish_skills()
        left = f"; recordings to be learned: {len(self.waiting)}" if self.waiting else ""
        self.report(Level.OK, f"ready; library {self.folder.path}{left}")

    def start(self) -> str:
        """Begin a recording of the task named by the parameter `task`; returns its path."""
        task = self.get_parameter("task").value
        path = self.folder.new_bag(task)
        hand = {HAND_LINK: self._hand_link} if self._hand_link else {}
        self.open_bag(path, {"task": task} | hand)
        self.report(Level.OK, f"recording {path.name}")
        return str(path)

    def stop(self) -> str:
        """End the recording and, with `learn_at_stop`, learn it; returns what changed.

        Raises:
            BagError: nothing is being recorded, or the recording cannot be read.
            TrainingError: it cannot be learned from; it is kept in the folder's `undone`.
        """
        bag = self.close_bag().path
        self.waiting.append(bag)
        if self.get_parameter("learn_at_stop").value:
            return self.learn()
        text = f"recorded {bag.name}; to be learned: {len(self.waiting)}"
        self.report(Level.OK, text)
        return text

    def learn(self) -> str:
        """Learn the waiting recordings and let the estimator use them; returns what changed.

        If one fails, those learned before it are used, and those after it keep waiting.

        Raises:
            BagError: nothing waits, or a recording cannot be read.
            ResourceBusyError, OSError: the folder is in use, or fails; the recording waits on, too.
            TrainingError: one cannot be learned from; it is kept in the folder's `undone`.
        """
        if not self.waiting:
            raise BagError.about("~/learn", "recordings", "none", "Record one first.")
        learned, doubts = list[str](), list[str]()
        change: Change | None = None
        failure: IntentError | OSError | None = None
        while self.waiting and failure is None:
            try:
                change = self.folder.learn(self.waiting[0])
                learned.append(self.waiting[0].name)
                doubts += self.folder.doubts
            except (IntentError, OSError) as error:
                failure = error
            if not isinstance(failure, (ResourceBusyError, OSError)):
                self.waiting.pop(0)
        what = "; ".join([f"learned {', '.join(learned)}", *(f"doubtful {one}" for one in doubts)])
        text = "" if change is None else self.changed(change, what)
        if failure is not None:
            self.report(Level.WARN, f"not learned: {failure}")
            raise failure
        return text

    def discard(self) -> str:
        """Move the recording under way, else the last that waits, to `undone` unlearned."""
        waits = self.recording is None and self.waiting
        bag = self.waiting.pop() if waits else self.close_bag("~/discard").path
        self.folder.prune(bag)
        text = f"{bag.name} is not learned, and kept in undone"
        self.report(Level.OK, text)
        return text

    def undo(self) -> str:
        """Take the last recording back; returns what changed."""
        change = self.folder.undo()
        return self.changed(change, f"took {Path(change.bag).name} back")

    def keep(self) -> str:
        """Learn from the last execution that a person corrected; returns what changed.

        Raises:
            ArgumentError: no execution was corrected, or the last one was kept before.
            TrainingError: it cannot be learned from; it is kept in the folder's `undone`.
        """
        with self._lock:
            self.executions.close()
        last = self._last_corrected()
        if last is None or self.folder.was_kept(last):
            wanted = "an execution that was corrected and not kept before"
            came = "none" if last is None else f"{last.name}, the last one, which was"
            cure = "Lead the arm by hand while it executes, then keep that."
            raise ArgumentError.about("~/keep", wanted, came, cure)
        change = self.folder.learn(self.folder.correct(last))
        return self.changed(change, f"kept the correction of {last.name}")

    def _last_corrected(self) -> Path | None:
        executions = self.executions.executions.all()
        bags = [self.folder.path / found.bag for found in executions if found.corrected]
        return next((bag for bag in reversed(bags) if bag.exists()), None)

    def heard(self, message: RawMessage) -> None:
        """Pass the message to the recorder of executions."""
        self.executions.take(message)

    def destroy_node(self) -> None:
        """Close the recordings, then the node."""
        with self._lock:
            self.executions.close()
        super().destroy_node()

    @property
    def is_recording(self) -> bool:
        """Whether a demonstration or an execution is being recorded."""
        return self.recording is not None or self.executions.is_recording

    def _practise(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        return answer(response, self.practice.start if request.data else self.practice.stop)

    def _on_active(self, message: String) -> None:
        with self._lock:
            self.executions.set_task(message.data)
        self._publish_skills()

    def _on_correction(self, data: bytes) -> None:
        with self._lock:
            self.executions.correct(data, now_ns(self))

    def _on_feedback(self, message: DiagnosticStatus) -> None:
        values = values_of(message)
        with self._lock:
            execution = self.executions.add(message.name, values)
        if THUMBS in values:
            self.practice.judge(message.name, execution, values[THUMBS])
        self._publish_skills()

    def _open_folder(self, values: Mapping[str, Any]) -> TaskFolder:
        library, dofs, model = values["library"], values["dofs"], values["model"]
        if not library:
            cure = "Start it with -p library:=DIR."
            raise ArgumentError.about("parameter library", "a folder", "nothing", cure)
        if model and not is_task_folder(Path(library)):
            load_trained(model)  # one without statistics is refused before anything is made
        folder = TaskFolder(library, library_dofs(library, model, dofs))
        if model and not folder.model_path.exists():
            folder.start_from(model)
        return folder

    def changed(self, change: Change, what: str) -> str:
        """Report what changed in the folder, and send the estimator the model; returns the text."""
        self._publish_skills()
        if change.action == WAIT:
            text = f"{what}; a first model needs two demonstrations of a task"
            self.report(Level.OK, text)
            return text
        tasks = ", ".join(f"{label} {n}" for label, n in change.tasks.items())
        text = f"{what}; demonstrations: {tasks or 'none'}"
        self.report(Level.OK, text)
        if change.model:
            self.send_model(text)
        return text

    def send_model(self, text: str) -> None:
        """Have the estimator load the library's model, or the one on trial."""
        if not self.estimator_runs():
            self.report(Level.OK, f"{text}; no estimator runs")
            return
        self.sending_model, self._asked_why, self._asked_s = True, text, time.monotonic()
        value = Parameter("model", value=self._model_in_force).to_parameter_msg()
        asked = self._set_model.call_async(SetParameters.Request(parameters=[value]))
        asked.add_done_callback(partial(self._named, text))

    def _named(self, text: str, future: Future) -> None:
        (result,) = future.result().results
        if result.successful:
            asked = self._reload.call_async(Trigger.Request())
            asked.add_done_callback(partial(self._loaded, text))
        else:
            self._not_loaded(text, result.reason)

    def _loaded(self, text: str, future: Future) -> None:
        answer = future.result()
        if not answer.success:
            self._not_loaded(text, answer.message)
            return
        self.sending_model, self._in_use = False, True
        self.practice.in_use()
        self.report(Level.OK, f"{text}; in use by {self._estimator_name}")

    def _not_loaded(self, text: str, why: str) -> None:
        self.sending_model = False
        self.report(Level.WARN, f"{text}; not loaded: {why}")

    def _on_reports(self, message: DiagnosticArray) -> None:
        """Detect an estimator that was restarted with another model, and send it the library's."""
        for status in message.status:
            if status.name != self._estimator_name:
                continue
            self.loaded = loaded = values_of(status).get(MODEL)
            if self.sending_model:
                if time.monotonic() - self._asked_s > ANSWER_S:
                    self.send_model(self._asked_why)
            elif loaded is None or loaded == self._model_in_force:
                self._in_use = self._in_use or loaded is not None
            # A trial left in the estimator by a teacher that has ended is replaced, too.
            elif self._in_use or Path(loaded).is_relative_to(self.folder.path / PRACTICE):
                self.send_model("the estimator was started again")

    @property
    def _model_in_force(self) -> str:
        return str(self.practice.trial or self.folder.model_path)

    def estimator_runs(self) -> bool:
        """Whether there is an estimator to give models to."""
        return self._set_model.service_is_ready() and self._reload.service_is_ready()

    def knows_loaded(self) -> bool:
        """Whether the estimator's model is of this library, or the one that it began with."""
        model = Path(self.loaded or "")
        own = model.is_relative_to(self.folder.path) or self.loaded == ""
        return own or (model.is_file() and self.folder.began_with(model))

    def _publish_skills(self) -> None:
        history = self.folder.history()
        last, skills = undoable(history), skill_history(history, self.executions.executions.all())
        corrected = self._last_corrected()
        to_keep = corrected and not self.folder.was_kept(corrected) and corrected.parent.name
        message = DiagnosticArray()
        message.header.stamp = self.get_clock().now().to_msg()
        for label, periods in skills.items():
            for one in periods[-20:]:
                numbers = zip(SKILL_COLUMNS, one.texts(), strict=True)
                values = {"since": one.since, "demonstrations": str(one.n_demonstrations)}
                if last is not None and (label, one.since) == (last.task, last.time):
                    values[TO_UNDO] = "yes"
                if label == to_keep:
                    values[TO_KEEP] = "yes"
                rows = key_values(values | dict(numbers))
                message.status.append(DiagnosticStatus(name=label, message=one.what, values=rows))
        self._skills.publish(message)

    def report(self, level: int, text: str) -> None:
        """Report a sentence on `teach/status`, in the diagnostics and in the log."""
        self.last_status = text
        self.diagnostics.value(WAITING, len(self.waiting))
        self._status.publish(String(data=text))
        self.diagnostics.status(level, text)
        self.diagnostics.publish()
        self.get_logger().info(text)


main = partial(run, TaskTeacher)

# SPDX-License-Identifier: Apache-2.0
"""Teaching while the graph runs: recorded, learned, in use, and taken back, with no restart."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from corrected_execution import execute
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from estimator_graph import message_for
from geometry_msgs.msg import PoseStamped
from model_builder import make_dofs, perform, true_library
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from intent_recognition.bags.reader import BagReader
from intent_recognition.errors import (
    ArgumentError,
    IntentError,
    ModelError,
    ResourceBusyError,
    TrainingError,
)
from intent_recognition.model import TO_KEEP, TO_UNDO, WAITING
from intent_recognition.model.file import Model, load_model, save_model
from intent_recognition.model.task_folder import Change
from intent_recognition.nodes import qos, task_teacher
from intent_recognition.nodes.conversions import (
    TrajectoryBuilder,
    to_joint_state,
    to_pose,
    to_stamp,
)
from intent_recognition.nodes.diagnostics import MODEL, key_values, values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.task_teacher import TaskTeacher
from intent_recognition.share import share_path
from intent_recognition.signals.observation import Observation, merge
from sim_bridge.arm import describe_robot

DOFS = make_dofs()
TRUTH = true_library(DOFS)
OLD, NEW = TRUTH.labels[:2], TRUTH.labels[2]
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])
LATER_NS = 100_000_000_000
"""Each movement begins so much later than the one of the seed before it."""


def movement(seed, *sides, task=2):
    """Messages of a movement of the new task, in order: (stamp, group, values)."""
    recording = perform(TRUTH, task, seed)
    signals = [signal for side in sides for signal in getattr(recording, side)]
    return [(int(o.stamp_ns) + seed * LATER_NS, o.group, o.values) for o in merge(signals)]


class Cell:
    """Estimator and teacher in one process, and who publishes what they hear."""

    def __init__(self, harness, library, model):
        self.harness = harness
        self.estimator = harness.node(IntentEstimatorNode, model=str(model))
        self.teacher = harness.node(TaskTeacher, model=str(model), library=str(library), task=NEW)
        self.pose = harness.publisher(PoseStamped, "mocap/wrist/pose", qos.SENSOR)
        self.joints = harness.publisher(JointState, "joint_states", qos.STATE)
        self.tasks = harness.said(self.estimator, "intent/tasks")
        self.said = harness.said(self.teacher, "teach/status")
        harness.spin_until(lambda: len(self.teacher.listening) == 2)
        harness.connect(self.pose, self.joints)

    def show(self, seed):
        """Publish a demonstration of the new task; returns when it is written."""
        sent = movement(seed, "observed", "controlled")
        writer = self.teacher._writer
        for number, (stamp, group, values) in enumerate(sent, writer.message_count + 1):
            self.publish(stamp, group, values)
            self.harness.spin_until(lambda n=number: writer.message_count >= n, poll_s=1e-3)

    def publish(self, stamp, group, values):
        if group == 0:
            message = PoseStamped(pose=to_pose(values, UPRIGHT))
            message.header.stamp, message.header.frame_id = to_stamp(stamp), "world"
            self.pose.publish(message)
        else:
            joints = DOFS.controlled_names
            self.joints.publish(to_joint_state(joints, values, time_ns=stamp))

    def call(self, service):
        return self.harness.trigger(f"task_teacher/{service}")

    def wait_said(self, text):
        self.harness.spin_until(lambda: any(text in m.data for m in self.said), what=text)

    def observe(self, seed):
        """Let the estimator see a movement; returns labels and the highest probability of each."""
        self.tasks.clear()
        for stamp, _, values in movement(seed, "observed"):
            message = message_for(DOFS, Observation(stamp, 0, values))
            self.harness.hear(self.estimator, "human/wrist", message)
        return list(self.tasks[-1].name), np.max([m.position for m in self.tasks], axis=0)


@pytest.mark.slow
def test_a_task_taught_while_the_graph_runs_is_recognised_and_taken_back(harness, tmp_path, model):
    cell = Cell(harness, tmp_path / "mine", model)
    for seed in (50, 51):
        assert cell.call("start").success
        cell.show(seed)
        answer = cell.call("stop")
        assert answer.success, answer.message
        cell.wait_said("in use")
        cell.said.clear()
    labels, probabilities = cell.observe(60)
    assert labels == [*OLD, NEW, "none"]
    assert probabilities[labels.index(NEW)] > 0.9
    assert max(probabilities[labels.index(label)] for label in OLD) < 0.9
    for _ in range(2):
        assert cell.call("undo").success
    cell.wait_said("in use")
    harness.spin_until(lambda: tuple(cell.estimator._model.labels) == OLD)
    assert "a change to take back" in cell.call("undo").message


REFUSED = SetParametersResult(reason="it is read-only")
NAMED = SetParametersResult(successful=True)
NOT_READ = Trigger.Response(message="it is damaged")
ANSWERS = [
    (REFUSED, None, "not loaded: it is read-only"),
    (NAMED, NOT_READ, "not loaded: it is damaged"),
    (NAMED, Trigger.Response(success=True), "in use by intent_estimator"),
]


@pytest.mark.parametrize("lost", [False, True])
@pytest.mark.parametrize(("named", "loaded", "said"), ANSWERS)
def test_a_model_is_in_use_only_once_it_was_named_and_loaded(
    harness, tmp_path, model, monkeypatch, named, loaded, said, lost
):
    """Where no answer comes, or the estimator was started again, it is sent again."""
    monkeypatch.setattr(task_teacher, "ANSWER_S", 0.0)
    teacher = harness.node(TaskTeacher, library=str(tmp_path / "mine"), model=str(model))

    def answer(*given):
        for client, found in zip((teacher._set_model, teacher._reload), given, strict=True):
            future = Future()
            if found is not None:
                future.set_result(found)
            client.service_is_ready = lambda: True
            client.call_async = lambda _, future=future: future

    if lost:
        answer(None, None)
        teacher.send_model("learned a")
        assert teacher.sending_model and "learned" not in teacher.last_status
    answer(SetParameters.Response(results=[named]), loaded)

    def report(model):
        status = DiagnosticStatus(name="intent_estimator", values=key_values({MODEL: model}))
        teacher._on_reports(DiagnosticArray(status=[status]))

    report("") if lost else teacher.send_model("learned a")
    assert teacher.last_status == f"learned a; {said}"
    report(str(teacher.folder.model_path))
    assert teacher.last_status == f"learned a; {said}"
    report("that of its start.npz")
    again = "the estimator was started again; in use by intent_estimator"
    assert (teacher.last_status == again) == ("in use" in said)


def test_executions_are_ended_while_nobody_writes_them(harness, tmp_path, model):
    teacher = harness.node(TaskTeacher, library=str(tmp_path / "mine"), model=str(model))
    held = []
    teacher.executions.close = lambda: held.append(teacher._lock._is_owned())
    with pytest.raises(IntentError):
        teacher.keep()
    harness.remove(teacher)
    assert held == [True, True]


def test_bad_requests_say_what_is_wrong_and_leave_the_model(harness, tmp_path, model):
    cell = Cell(harness, tmp_path / "mine", model)
    assert "Start one first" in cell.call("stop").message
    (refused,) = cell.teacher.set_parameters([Parameter("task", value="a/b")])
    assert "task" in refused.reason
    cell.teacher.set_parameters([Parameter("task", value=NEW)])
    assert cell.call("start").success
    assert "recording" in cell.call("start").message
    empty = cell.call("stop")
    assert not empty.success
    assert cell.teacher.folder.history()[-1].action == "start"
    assert cell.call("start").success
    assert cell.call("discard").success
    undone = tmp_path / "mine" / "undone" / NEW
    assert len(list(undone.iterdir())) == 2
    cell.teacher.set_parameters([Parameter("learn_at_stop", value=False)])
    assert cell.call("start").success and cell.call("stop").success
    assert len(cell.teacher.waiting) == 1
    assert values_of(cell.teacher.diagnostics.report())[WAITING] == "1"
    assert cell.call("discard").success and not cell.teacher.waiting
    assert values_of(cell.teacher.diagnostics.report())[WAITING] == "0"
    assert len(list(undone.iterdir())) == 3
    assert not cell.call("discard").success
    (lock := tmp_path / "mine" / ".lock").unlink()
    lock.mkdir()  # as where the disk fails
    assert "Is a directory" in cell.call("undo").message


def test_a_library_is_asked_for(harness):
    with pytest.raises(ArgumentError, match="library"):
        TaskTeacher()


def test_a_model_without_statistics_is_refused(harness, tmp_path, model):
    bare = load_model(model)
    save_model(tmp_path / "bare.npz", Model(bare.library, bare.dofs))
    values = {"library": str(tmp_path / "mine"), "model": str(tmp_path / "bare.npz")}
    with pytest.raises(ModelError, match="statistics"):
        harness.node(TaskTeacher, **values)
    assert not (tmp_path / "mine").exists()


@pytest.mark.parametrize("error", [TrainingError, ResourceBusyError, OSError])
def test_what_was_learned_before_one_fails_is_used(harness, tmp_path, model, error):
    values = {"library": str(tmp_path / "mine"), "model": str(model)}
    teacher = harness.node(TaskTeacher, **values)

    def learn(bag):
        if bag.name == "b":
            raise error("b is none")
        return Change("", "learn", OLD[0], bag.name, "model.npz", {OLD[0]: 5})

    teacher.folder.learn, sent = learn, []
    teacher.send_model = sent.append
    teacher.waiting += [Path(name) for name in "abc"]
    with pytest.raises(error):
        teacher.learn()
    assert sent == [f"learned a; demonstrations: {OLD[0]} 5"]
    assert len(teacher.waiting) == (1 if error is TrainingError else 2)


def test_with_another_arm_its_description_and_the_name_of_its_hand_are_recorded(harness, tmp_path):
    values = {"library": str(tmp_path / "tasks"), "task": "wave", "hand_link": "my_tool"}
    values["dofs"] = str(share_path("config/dofs_hand.yaml"))
    teacher = harness.node(TaskTeacher, **values)
    description = harness.publisher(String, "robot_description", qos.LATCHED)
    description.publish(String(data=describe_robot()))
    harness.spin_until(lambda: teacher.listening)
    bag = teacher.start()
    harness.spin_until(lambda: teacher._writer.message_count)
    teacher.close_bag()
    assert {"/joint_states", "/robot_description"} <= set(teacher.wanted)
    reader = BagReader(bag)
    assert reader.custom_data["hand_link"] == "my_tool"
    (recorded,) = reader.messages(["/robot_description"])
    assert recorded.message.data == describe_robot()


@pytest.mark.slow
def test_an_execution_is_recorded_judged_and_kept(harness, tmp_path, model):
    cell = Cell(harness, tmp_path / "mine", model)
    teacher, label, log = cell.teacher, OLD[0], cell.teacher.executions.executions
    execute(teacher.folder, perform(TRUTH, 0, 40))  # nobody wanted to keep this one
    hear, skills = partial(harness.hear, teacher), harness.said(teacher, "teach/skills")
    heard = []
    take = teacher.executions.take
    teacher.executions.take = lambda *args: (heard.append(args), take(*args))

    def tell(**values):
        rows = [KeyValue(key=key, value=value) for key, value in values.items()]
        hear("intent/feedback", DiagnosticStatus(name=label, values=rows))

    sent = movement(70, "observed", "controlled", task=0)
    for number, one in enumerate(sent, 1):
        if number == len(sent) // 2:  # recognised amid the movement: what came before counts
            hear("intent/active_task", String(data=label))
        cell.publish(*one)
        harness.spin_until(lambda n=number: len(heard) >= n, poll_s=1e-3)
    times_s = np.linspace(0.0, 2.0, 21)
    truth = [values for _, group, values in sent if group == 1]
    path = np.linspace(truth[0], truth[-1] + 0.2, 21)
    builder = TrajectoryBuilder(tuple(DOFS.controlled_names))
    message = builder.build(sent[0][0] + 800_000_000, times_s, path, np.zeros_like(path))
    message.header.frame_id = label
    hear("intent/correction", message)
    tell(outcome="arrived", corrections="1")
    hear("intent/active_task", String(data=""))
    assert len(log.all()) == 2
    tell(thumbs="up")
    assert dict(log.all()[-1].values) == {"outcome": "arrived", "corrections": "1", "thumbs": "up"}
    before = cell.estimator._model.library
    answer = cell.call("keep")
    assert answer.success, answer.message
    cell.wait_said("kept the correction of")
    harness.spin_until(lambda: cell.estimator._model.library is not before)
    after = cell.estimator._model.library
    k, other = (before.labels.index(one) for one in OLD)
    assert not np.allclose(after.weight_mean[k], before.weight_mean[k], atol=1e-3)
    assert np.array_equal(after.weight_mean[other], before.weight_mean[other])
    again = cell.call("keep")
    assert not again.success and "0001, the last one" in again.message
    assert cell.call("undo").success
    told = [(row.name, row.message) for row in skills[-1].status if row.name == label]
    assert [text for _, text in told][-2:] == ["kept 0001", "took 0001_kept back"]
    marked = [
        [any(key in values_of(row) for row in one.status) for key in (TO_KEEP, TO_UNDO)]
        for one in skills[-3:]
    ]
    assert marked == [[True, False], [False, True], [False, False]]

# SPDX-License-Identifier: Apache-2.0
"""A task made of parts on the topics: recognised, then by itself through a via point, then left."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from estimator_graph import DOFS, Folder
from model_builder import make_dofs, true_library
from nav_msgs.msg import Odometry
from nodes.test_primitive_activation import HOME, Graph, check_commands
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.composing import ViaPoint, write_via_points
from intent_recognition.errors import ArgumentError
from intent_recognition.model import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_pose
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.plans import read_plan
from intent_recognition.promp import controlled_at
from intent_recognition.recognition.transitions import HABIT_TRUST

STEPS = """
toolbox:
- task: plate
- task: screw
  when: {wrist_in: {center: [0.5, 0.0, 0.2], radius: 0.1}}
"""


@pytest.fixture
def given(tmp_path):
    """A model of the two tasks about the home posture, and a file of a sequence."""
    library = true_library(make_dofs(), n_tasks=2)
    mean = library.weight_mean.reshape(2, 10, -1).copy()
    mean[:, 3:] += HOME[:, None]
    library = replace(library, labels=("plate", "screw"), weight_mean=mean.reshape(2, -1))
    model, steps = tmp_path / "model.npz", tmp_path / "steps.yaml"
    save_model(model, Model(library, make_dofs()))
    steps.write_text(STEPS)
    return library, {"model": str(model), "sequences": str(steps)}


@pytest.mark.slow
def test_a_task_of_two_parts_with_a_via_point_and_another_task_leads_out(harness, given):
    library, parameters = given
    told = harness.collect(DiagnosticStatus, "intent/sequence", qos.LATCHED)
    points = harness.publisher(String, "intent/via_points", qos.LATCHED)
    wrist = harness.publisher(Odometry, "human/wrist", qos.SENSOR)
    graph = Graph(harness, **parameters)
    harness.connect(points, wrist)
    end = controlled_at(library, 1, 1.0)
    goal = float(end.mean[3] + 2.0 * np.sqrt(end.covariance[3, 3]))
    point = ViaPoint("end", {"lwr_a4_joint": (goal,)}, (1e-4,), 1.0, None, "screw")
    points.publish(String(data=write_via_points([point])))
    graph.begin("plate")
    graph.until(lambda: graph.node.activation.arrived)
    graph.task = "idle"
    graph.until(lambda: told and "screw (2 of 2) waits" in told[-1].message)
    assert values_of(told[-1])["task"] == "screw"
    graph.run(10)
    assert graph.active[-1].data == "plate", "the wrist is not there"
    back = Odometry()
    back.pose.pose = to_pose(np.array([0.5, 0.05, 0.2]), (0.0, 0.0, 0.0, 1.0))

    def begun():
        wrist.publish(back)
        return graph.active[-1].data == "screw"

    graph.until(begun)
    graph.until(lambda: told[-1].message.endswith("runs"))
    graph.until(lambda: graph.node.activation.arrived)
    assert abs(graph.arm()[3] - goal) < 2e-3
    graph.until(lambda: told[-1].message == "no sequence")
    check_commands(graph.commands)


def test_a_place_is_fresh_by_the_clock_of_the_node(harness, given, monkeypatch):
    node = harness.node(PrimitiveActivation, **given[1], use_sim_time=True)
    harness.set_clock(node, 10**9)
    node._sequences._take_place("wrist", Odometry())
    monkeypatch.setattr("time.monotonic", lambda: np.inf)
    inbox = SimpleNamespace(decision=SimpleNamespace(idle=True))
    idle = SimpleNamespace(inbox=inbox, counts={"started": 0}, active_task="", arrived=False)
    assert [*node._sequences._moment(idle).places] == ["wrist"]


def test_a_step_that_was_forgotten_is_not_taken_for_begun(harness, given):
    runner = harness.node(PrimitiveActivation, **given[1])._sequences
    inbox = SimpleNamespace(decision=SimpleNamespace(idle=True), order=None, ordered=None)
    going = SimpleNamespace(inbox=inbox, counts={"started": 1}, active_task="plate", arrived=False)
    runner.update(going, None, None)
    assert runner._progress.name == "toolbox"
    runner.forget()
    runner.update(going, None, None)
    assert runner._progress.name == ""


def test_another_model_is_that_of_the_orders_and_must_have_the_tasks(harness, given):
    library, parameters = given
    runner = harness.node(PrimitiveActivation, **parameters)._sequences
    other = replace(library, weight_mean=library.weight_mean + 0.1)
    runner.configure(other)
    assert runner._library is other and runner._node.count_subscribers("human/wrist") == 1
    with pytest.raises(ArgumentError, match="screw"):
        runner.configure(replace(library, labels=("plate", "glue")))


def test_sequences_need_a_model_and_a_file(harness, given, tmp_path):
    _, parameters = given
    with pytest.raises(ArgumentError, match="sequences: expected a model"):
        Graph(harness, sequences=parameters["sequences"])
    with pytest.raises(ArgumentError, match=r"sequences .*none\.yaml: expected a file"):
        Graph(harness, **parameters | {"sequences": str(tmp_path / "none.yaml")})


@pytest.mark.slow
def test_the_estimator_expects_the_step(harness, tmp_path):
    folder = Folder(tmp_path, DOFS)
    status = harness.publisher(DiagnosticStatus, "intent/sequence", qos.LATCHED)

    status.publish(DiagnosticStatus(values=[KeyValue(key="task", value="task_1")]))
    node = harness.node(IntentEstimatorNode, model=str(folder.path))
    expectation = node.people[""].estimator.expectation
    harness.spin_until(lambda: expectation.prior[1] > HABIT_TRUST, what="the step")
    status.publish(DiagnosticStatus(message="no sequence"))
    harness.spin_until(lambda: expectation.prior[1] < HABIT_TRUST, what="no step")


TEXT = (
    "steps: [{step: forgotten_0, task: task_0}, {step: task_1}]\n"
    "by_hand: {forgotten_0 < task_1: 1}\n"
)


def node_of(harness, tmp_path, plan):
    folder = Folder(tmp_path, DOFS)
    values = {"model": str(folder.path), "plan": plan}
    return harness.node(IntentEstimatorNode, **values)


@pytest.mark.slow
def test_a_plan_is_told_expected_and_changed(harness, tmp_path):
    file = tmp_path / "plan.yaml"
    file.write_text(TEXT)
    told = harness.collect(DiagnosticStatus, "intent/plan", qos.LATCHED)
    expected = harness.collect(JointState, "intent/next_task", qos.LATCHED)
    node = node_of(harness, tmp_path, str(file))
    harness.spin_until(lambda: told, what="the plan")
    assert told[-1].message == "may come: forgotten_0"
    assert told[-1].level == DiagnosticStatus.OK
    rows = values_of(told[-1])
    assert rows["forgotten_0"] == "may come 0.00" and rows["task_1"] == "later 0.00"
    assert read_plan(rows["yaml"]) == read_plan(TEXT)
    harness.spin_until(lambda: expected and expected[-1].position[0] > 0.7, what="its prior")
    turned = TEXT.replace("forgotten_0 < task_1", "task_1 < forgotten_0")
    (result,) = node.set_parameters([Parameter("plan", value=turned)])
    assert result.successful, result.reason
    harness.spin_until(lambda: told[-1].message == "may come: task_1", what="the other plan")
    (result,) = node.set_parameters([Parameter("plan", value="steps: [{step: other}]\n")])
    assert not result.successful and "other" in result.reason
    node.set_parameters([Parameter("plan", value="")])
    harness.spin_until(lambda: told[-1].message == "no plan", what="no plan")


def test_a_plan_must_be_there(harness, tmp_path):
    with pytest.raises(ArgumentError, match=r"plan .*: expected a file"):
        node_of(harness, tmp_path, str(tmp_path / "none.yaml"))


def test_the_plan_in_force_is_saved_where_it_came_from(harness, tmp_path):
    file = tmp_path / "plan.yaml"
    file.write_text(TEXT)
    node = node_of(harness, tmp_path, str(file))
    changed = "steps: [{step: task_1}]\n"
    node.set_parameters([Parameter("plan", value=changed)])
    answer = harness.trigger("intent_estimator/save_plan")
    assert answer.success and str(file) in answer.message
    assert read_plan(file.read_text()) == read_plan(changed)
    node.set_parameters([Parameter("plan", value="")])
    answer = harness.trigger("intent_estimator/save_plan")
    assert not answer.success and "from a file" in answer.message

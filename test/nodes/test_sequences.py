# SPDX-License-Identifier: Apache-2.0
"""The activation goes ahead to where the expected task begins, and runs tasks made of parts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from estimator_graph import DOFS, Folder
from model_builder import WRIST, learned_model, make_dofs, true_library
from nav_msgs.msg import Odometry
from nodes.test_primitive_activation import HOME, LABELS, Graph, check_commands
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from intent_recognition.composing import ViaPoint, write_via_points
from intent_recognition.errors import ArgumentError
from intent_recognition.model import Model, save_model
from intent_recognition.nodes import qos
from intent_recognition.nodes.conversions import to_joint_state, to_pose
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.primitive_activation import PrimitiveActivation
from intent_recognition.plans import read_plan
from intent_recognition.promp import controlled_at
from intent_recognition.recognition.start_posture import start_mean
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
    graph = Graph(harness, **parameters)
    told = harness.said(graph.node, "intent/sequence")
    end = controlled_at(library, 1, 1.0)
    goal = float(end.mean[3] + 2.0 * np.sqrt(end.covariance[3, 3]))
    point = ViaPoint("end", {"lwr_a4_joint": (goal,)}, (1e-4,), 1.0, None, "screw")
    graph.hear("intent/via_points", String(data=write_via_points([point])))
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
        graph.hear("human/wrist", back)
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
    node = harness.node(IntentEstimatorNode, model=str(folder.path))
    expectation = node.people[""].estimator.expectation
    step = DiagnosticStatus(values=[KeyValue(key="task", value="task_1")])
    harness.hear(node, "intent/sequence", step)
    assert expectation.prior[1] > HABIT_TRUST
    harness.hear(node, "intent/sequence", DiagnosticStatus(message="no sequence"))
    assert expectation.prior[1] < HABIT_TRUST


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
    more = turned.replace("{step: task_1}]", "{step: task_1}, {step: lid}, {step: rest, task: ''}]")
    (result,) = node.set_parameters([Parameter("plan", value=more)])
    assert result.successful, result.reason
    message = "may come: task_1; not learned: lid (lid)"
    harness.spin_until(lambda: told[-1].message == message, what="the other plan")
    (result,) = node.set_parameters([Parameter("plan", value="steps: [{step: other}]\n")])
    assert not result.successful and "other" in result.reason
    node.set_parameters([Parameter("plan", value="")])
    harness.spin_until(lambda: told[-1].message == "no plan", what="no plan")


@pytest.mark.parametrize("name", ["none.yaml", "\0"])
def test_a_plan_must_be_there(harness, tmp_path, name):
    with pytest.raises(ArgumentError, match=r"plan .*: expected a file"):
        node_of(harness, tmp_path, str(tmp_path / name))


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


TASKS = LABELS[:2]
AHEAD = HOME + np.array([0.3, -0.2, 0.1, -0.2, 0.0, -0.1, 0.4])


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A model whose plate begins at home and whose screw begins elsewhere."""
    dofs = make_dofs(WRIST)
    model = learned_model(dofs, true_library(dofs, n_tasks=2))
    library = model.library
    means = library.weight_mean.copy()
    for task, start in enumerate((HOME, AHEAD)):  # the basis functions sum to one
        shift = start - start_mean(library, task)
        means[task, library.n_observed_weights :] += np.repeat(shift, library.basis.n_basis)
    library = replace(library, labels=TASKS, weight_mean=means)
    np.testing.assert_allclose(start_mean(library, 1), AHEAD, atol=1e-9)
    path = tmp_path_factory.mktemp("ahead") / "model.npz"
    save_model(path, replace(model, library=library))
    return path


class AheadGraph(Graph):
    """The fake estimator also says what it expects, when a movement has ended."""

    def __init__(self, harness, path, **parameters):
        values = {"model": str(path), "pretrigger_threshold": 0.7, **parameters}
        super().__init__(harness, **values)

    def expect(self, p=(0.1, 0.9), ahead_s=0.0):
        message = to_joint_state(TASKS, p, time_ns=self.now_ns + round(ahead_s * 1e9))
        self.hear("intent/next_task", message)


@pytest.mark.slow
def test_it_waits_at_the_start_of_the_expected_task(harness, path):
    graph = AheadGraph(harness, path)
    graph.begin("plate")
    graph.until(lambda: graph.mode == "executing")
    graph.run(30)
    graph.task = "idle"
    graph.step()
    graph.expect()
    graph.until(lambda: graph.mode == "pretriggered")
    graph.run(100)
    np.testing.assert_allclose(graph.arm(), AHEAD, atol=1e-6)
    status, values = graph.report()
    assert status.message == "pretriggered: screw" and values["mode"] == "pretriggered"
    assert values["expected task"] == "screw (0.90)" and values["count pretriggered"] == "1"
    assert values["count activated"] == "1" and values["active task"] == "none"
    check_commands(graph.commands)


def test_bad_expectations_are_counted_and_not_used(harness, path):
    graph = AheadGraph(harness, path)
    graph.expect((0.9, 0.9))
    assert graph.rejected("bad_next_task") == 1
    graph.expect(ahead_s=0.9)  # as clocks of a graph may differ
    graph.step()
    assert graph.report()[1]["expected task"] == "screw (0.90)"
    graph.expect((0.8, 0.2), ahead_s=1.1)
    graph.step()
    assert graph.rejected("stamp_in_future") == 1
    assert graph.report()[1]["expected task"] == "screw (0.90)"
    graph.expect((0.7, 0.3))
    graph.step()
    assert graph.report()[1]["expected task"] == "plate (0.70)"


@pytest.mark.parametrize(("limit", "told"), [(1e-5, True), (10.0, False)])
def test_tasks_whose_ends_are_never_certain_enough_are_told_at_start(harness, path, limit, told):
    graph = AheadGraph(harness, path, max_end_std=limit)
    values = graph.report()[1]
    for task in TASKS:
        key = f"never certain enough: {task} [rad]"
        assert (key in values) == told
        assert not told or float(values[key]) >= 0.0

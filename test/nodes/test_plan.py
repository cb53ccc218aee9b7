# SPDX-License-Identifier: Apache-2.0
"""The plan of an assembly on the topics: read, followed, told and changed."""

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from estimator_graph import DOFS, Folder
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes import qos
from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.plans import read_plan

TEXT = "steps: [{step: task_0}, {step: task_1}]\nby_hand: {task_0 < task_1: 1}\n"


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
    assert told[-1].message == "may come: task_0"
    rows = values_of(told[-1])
    assert rows["task_0"] == "may come 0.00" and rows["task_1"] == "later 0.00"
    assert read_plan(rows["yaml"]) == read_plan(TEXT)
    harness.spin_until(lambda: expected and expected[-1].position[0] > 0.7, what="its prior")
    turned = TEXT.replace("task_0 < task_1", "task_1 < task_0")
    (result,) = node.set_parameters([Parameter("plan", value=turned)])
    assert result.successful, result.reason
    harness.spin_until(lambda: told[-1].message == "may come: task_1", what="the other plan")
    (result,) = node.set_parameters([Parameter("plan", value="steps: [{step: other}]\n")])
    assert not result.successful and "other" in result.reason
    node.set_parameters([Parameter("plan", value="")])
    harness.spin_until(lambda: told[-1].message == "no plan", what="no plan")


def test_a_plan_must_be_there(harness, tmp_path):
    with pytest.raises(ArgumentError, match="plan: expected a file"):
        node_of(harness, tmp_path, str(tmp_path / "none.yaml"))


def test_the_plan_in_force_is_saved_where_it_came_from(harness, tmp_path):
    file = tmp_path / "plan.yaml"
    file.write_text(TEXT)
    node = node_of(harness, tmp_path, str(file))
    changed = "steps: [{step: task_1}]\n"
    node.set_parameters([Parameter("plan", value=changed)])
    answer = harness.call(Trigger, "intent_estimator/save_plan", Trigger.Request())
    assert answer.success and str(file) in answer.message
    assert read_plan(file.read_text()) == read_plan(changed)
    node.set_parameters([Parameter("plan", value="")])
    answer = harness.call(Trigger, "intent_estimator/save_plan", Trigger.Request())
    assert not answer.success and "from a file" in answer.message

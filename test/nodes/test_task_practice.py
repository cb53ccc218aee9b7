# SPDX-License-Identifier: Apache-2.0
"""Practice by services of the teacher: by a cost, or by the thumbs of a person."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.parameter import Parameter
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from intent_recognition.nodes.diagnostics import values_of
from intent_recognition.nodes.intent_estimator import IntentEstimatorNode
from intent_recognition.nodes.task_teacher import TaskTeacher

TASK = "task_0"


def practising(harness, library, model):
    """A teacher that practises, and its services."""
    values = {"library": str(library), "model": str(model), "task": TASK, "practice_cost": "time"}
    teacher = harness.node(TaskTeacher, **values, practice_rollouts=14)

    def call(service, kind=Trigger, **fields):
        return harness.call(kind, f"task_teacher/{service}", kind.Request(**fields))

    return teacher, call


@pytest.mark.slow
def test_practice_begins_ends_goes_on_and_is_accepted_by_services(harness, tmp_path, model):
    teacher, call = practising(harness, tmp_path / "mine", model)
    before = teacher.folder.model_path.read_bytes()
    assert "Practise first" in call("accept").message
    assert "Begin one first" in call("practise", SetBool, data=False).message
    assert call("practise", SetBool, data=True).success
    assert "End it first" in call("practise", SetBool, data=True).message
    harness.spin_until(lambda: teacher.diagnostics._values.get("practice"))
    assert call("practise", SetBool, data=False).success
    done = len(teacher.practice._begun.session.tried)
    assert 0 < done < 14
    assert call("start").success  # while something is recorded, it waits
    assert call("practise", SetBool, data=True).success
    teacher.practice.step()
    assert len(teacher.practice._begun.session.tried) == done
    assert call("discard").success
    harness.spin_until(lambda: not teacher.practice.running)
    shown = values_of(teacher.diagnostics.report())
    assert shown["practice"] == f"{TASK}, 14 of 14"
    assert teacher.folder.model_path.read_bytes() == before
    answer = call("accept")
    assert answer.success, answer.message
    assert teacher.folder.history()[-1].action == "improve"
    assert call("undo").success
    assert teacher.folder.model_path.read_bytes() == before
    teacher.set_parameters([Parameter("practice_cost", value="/tmp/mine.py")])
    assert "one of distance, time, thumbs" in call("practise", SetBool, data=True).message
    teacher.set_parameters([Parameter("practice_beside", value="1 2")])
    teacher.set_parameters([Parameter("practice_cost", value="time")])
    assert "three numbers" in call("practise", SetBool, data=True).message


@pytest.mark.slow
def test_thumbs_of_the_page_judge_the_points_that_the_estimator_tries(harness, tmp_path, model):
    teacher, call = practising(harness, tmp_path / "mine", model)
    teacher.set_parameters([Parameter("practice_cost", value="thumbs")])
    assert "an estimator" in call("practise", SetBool, data=True).message
    estimator = harness.node(IntentEstimatorNode, model=str(model))
    harness.spin_until(teacher.estimator_runs)
    log = teacher.executions.executions

    def judge(thumbs):
        message = DiagnosticStatus(name=TASK, values=[KeyValue(key="thumbs", value=thumbs)])
        harness.hear(teacher, "intent/feedback", message)

    def execute(n):
        for active in (TASK, ""):
            harness.hear(teacher, "intent/active_task", String(data=active))
        assert len(log.all()) == n

    execute(1)
    teacher.set_parameters([Parameter("practice_rollouts", value=2)])
    assert call("practise", SetBool, data=True).success
    harness.spin_until(lambda: teacher.practice._judged_before)
    judge("up")  # of an execution from before: it does not count
    assert log.all()[0].values["thumbs"]
    session, library = teacher.practice._begun.session, str(teacher.folder.model_path)
    assert not session.tried
    assert estimator.get_parameter("model").value == str(teacher.practice.trial) != library
    execute(2)
    judge("down")
    harness.spin_until(lambda: len(session.tried) == 1 and teacher.practice._judged_before)
    execute(3)
    judge("up")
    harness.spin_until(lambda: estimator.get_parameter("model").value == library)
    assert session.costs.tolist() == [1.0, 0.0]
    assert [one.bag for one in session.tried] == [one.bag for one in log.all()[1:]]
    assert np.abs(session.points[0]).max() == 0.0 < np.abs(session.points[1]).max()

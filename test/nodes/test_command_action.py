# SPDX-License-Identifier: Apache-2.0
"""The activation drives a controller by its action FollowJointTrajectory."""

import copy
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from activation_graph import Graph
from rclpy.task import Future
from ros_harness import NodeProcess
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes import command_action
from intent_recognition.nodes.diagnostics import Level

pytestmark = pytest.mark.slow
ACTION = "joint_trajectory_controller/follow_joint_trajectory"


@pytest.fixture(scope="module")
def result(ros_interfaces):
    """The action's result; control_msgs is importable here and in other processes."""
    ros_interfaces("control_msgs")
    from control_msgs.action import FollowJointTrajectory

    return FollowJointTrajectory.Result


class Goal:
    """A goal as its client sees it; what becomes of it is up to the test."""

    def __init__(self, result):
        self.accepted = self.cancelled = False
        self.answer, self.end, self._type = Future(), Future(), result

    def accept(self):
        self.accepted = True
        self.answer.set_result(self)

    def reject(self):
        self.answer.set_result(self)

    def finish(self, status, code="SUCCESSFUL", text=""):
        found = self._type(error_code=getattr(self._type, code), error_string=text)
        status = getattr(GoalStatus, f"STATUS_{status}")
        self.end.set_result(SimpleNamespace(status=status, result=found))

    def get_result_async(self):
        return self.end

    def cancel_goal_async(self):
        self.cancelled = True


class Client:
    """An action client whose controller accepts goals at once, if it `accepts`."""

    def __init__(self, result):
        self.goals, self.accepts, self.ready, self._result = [], True, True, result

    def server_is_ready(self):
        return self.ready

    def send_goal_async(self, *_, **__):
        self.goals.append(Goal(self._result))
        if self.accepts:
            self.goals[-1].accept()
        return self.goals[-1].answer


class Cell(Graph):
    """The graph of `test_primitive_activation`, whose commands are goals."""

    def __init__(self, harness, client=None):
        super().__init__(harness, command_action=ACTION, switch_lead=0.05)
        self.commands, self.client, action = [], client, self.node._action
        action._client, publish = client or action._client, action.publish

        def note(message):
            self.commands.append(copy.deepcopy(message))
            publish(message)

        action.publish = note


@pytest.fixture
def cell(harness, result):
    return Cell(harness, Client(result))


def test_goals_of_a_real_controller_are_accepted_replaced_and_succeed_and_its_end_is_seen(
    harness, result, repository, monkeypatch
):
    monkeypatch.setattr(command_action, "ANSWER_S", np.inf)  # however late it is
    script = repository / "test" / "trajectory_controller.py"
    with NodeProcess(sys.executable, str(script)):
        cell = Cell(harness)
        harness.spin_until(cell.node._action._client.server_is_ready, what="the controller")
        cell.begin()

        def step_until(mode):
            cell.until(lambda: harness.executor.spin_once(timeout_sec=0.0) or cell.mode == mode)

        step_until("executing")
        step_until("homing")
        step_until("idle")
        harness.spin_until(lambda: cell.node._action._newest is None, what="the last result")
        assert len(cell.commands) > 2
        assert cell.node.activation.counts.keys().isdisjoint({"stopped: controller_aborted"})
        status, values = cell.report()
        assert status.level != bytes([Level.ERROR]) and "controller" not in status.message
        assert values["controller error [rad]"] == "0.020"
    harness.spin_until(lambda: not cell.node._action._client.server_is_ready(), what="its end")


def violate(cell, goal):
    goal.accept()
    goal.finish("ABORTED", "PATH_TOLERANCE_VIOLATED", "joint 3")


def cancel(cell, goal):
    goal.accept()
    goal.finish("CANCELED")


def wait(cell, goal):
    cell.now_ns += 1_100_000_000
    cell.harness.set_clock(cell.node, cell.now_ns)


def leave(cell, goal):
    cell.client.ready = False


@pytest.mark.parametrize(
    ("happens", "reason", "text"),
    [
        (lambda cell, goal: goal.reject(), "controller_rejected", "rejected a goal"),
        (violate, "controller_aborted", "path tolerance violated: joint 3"),
        (cancel, "controller_cancelled", "cancelled by somebody else"),
        (wait, "controller_silent", "no answer"),
        (leave, "controller_missing", "is gone"),
    ],
)
def test_a_goal_that_is_not_executed_ends_the_interaction(cell, happens, reason, text):
    cell.client.accepts = False
    cell.begin()
    cell.until(lambda: cell.commands)
    (goal,) = cell.client.goals
    happens(cell, goal)
    cell.node._look_for_silence()
    assert cell.rejected(reason) == 1
    assert cell.mode == "idle" and cell.node.activation.active_task == ""
    status, _ = cell.report()
    assert status.level == bytes([Level.ERROR]) and text in status.message
    cell.run(50)  # the same movement begins none anew
    assert len(cell.commands) == 1
    if happens is wait:
        goal.accept()  # late
        assert goal.cancelled
    cell.client.accepts = cell.client.ready = True
    stand = cell.arm()
    cell.task = "idle"
    cell.run(50)
    cell.begin("screw")
    cell.until(lambda: cell.mode == "executing")
    np.testing.assert_allclose(cell.commands[-1].points[0].positions, stand, atol=0.05)
    assert not cell.node._action.trouble


@pytest.mark.parametrize(
    ("status", "code", "reason"),
    [
        ("CANCELED", "SUCCESSFUL", "controller_cancelled"),
        ("ABORTED", "PATH_TOLERANCE_VIOLATED", "controller_aborted"),
        ("ABORTED", "INVALID_GOAL", ""),  # replaced
    ],
)
def test_a_goal_that_ends_while_the_next_is_on_its_way_ends_the_interaction(
    cell, status, code, reason
):
    """Its result comes after the next goal was sent, which is cancelled, too."""
    cell.begin()
    cell.until(lambda: len(cell.client.goals) == 2)
    before, update = cell.client.goals
    before.finish(status, code)
    assert update.cancelled == bool(reason)
    assert (cell.mode == "idle") == bool(reason)
    assert cell.node.diagnostics._counts == ({reason: 1} if reason else {})


def test_who_commands_the_controller_by_its_topic_is_refused(cell):
    topic = "joint_trajectory_controller/joint_trajectory"
    cell.harness.probe.create_publisher(JointTrajectory, topic, 1)
    cell.harness.spin_until(lambda: cell.node._output.shared, what="who else commands")
    status, values = cell.report()
    assert status.level == bytes([Level.ERROR]) and "shared arm" in status.message
    assert values["rejected shared_arm"] == "1"


@pytest.mark.parametrize("late", [False, True])
def test_a_rejected_update_cancels_the_goal_under_way_or_once_it_is_accepted(cell, late):
    """Answers of a controller with several threads come in any order."""
    cell.client.accepts = False
    cell.begin()
    cell.until(lambda: len(cell.client.goals) == 2)
    under_way, update = cell.client.goals
    for goal in (update, under_way) if late else (under_way, update):
        (goal.reject if goal is update else goal.accept)()
    assert cell.rejected("controller_rejected") == 1
    assert under_way.cancelled and not update.cancelled


def test_a_late_result_of_a_cancelled_goal_leaves_the_next_interaction_alone(cell):
    cell.begin()
    cell.until(lambda: cell.client.goals)
    cell.client.accepts = False
    cell.until(lambda: len(cell.client.goals) == 2)
    given_up, update = cell.client.goals
    update.reject()
    cell.client.accepts, cell.task = True, "idle"
    cell.run(50)
    cell.begin("screw")
    cell.until(lambda: cell.mode == "executing")
    given_up.finish("ABORTED", "PATH_TOLERANCE_VIOLATED")
    assert cell.mode == "executing" and not cell.client.goals[-1].cancelled
    assert cell.node.diagnostics._counts == {"controller_rejected": 1}


def test_a_goal_tolerance_is_told_and_the_arm_goes_home(cell):
    cell.begin()
    cell.until(lambda: cell.mode == "homing")
    cell.until(lambda: cell.mode == "idle")
    cell.client.goals[-1].finish("ABORTED", "GOAL_TOLERANCE_VIOLATED", "joint 3")
    cell.run(5)
    assert cell.rejected("goal_tolerance_violated") == 1
    assert "goal tolerance violated: joint 3" in cell.report()[0].message
    assert not any("controller" in reason for reason in cell.node.activation.counts)


def test_without_control_msgs_the_node_says_what_to_install(harness, monkeypatch):
    monkeypatch.setitem(sys.modules, "control_msgs.action", None)
    with pytest.raises(ArgumentError, match="ros-jazzy-control-msgs"):
        Graph(harness, command_action=ACTION)

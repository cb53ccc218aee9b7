# SPDX-License-Identifier: Apache-2.0
"""The activation drives a controller of another process by its action FollowJointTrajectory."""

import copy
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from activation_graph import Graph
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from ros_harness import NodeProcess
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes import command_action
from intent_recognition.nodes.diagnostics import Level

pytestmark = pytest.mark.slow
ACTION = "joint_trajectory_controller/follow_joint_trajectory"


@pytest.fixture(scope="module")
def interfaces(ros_interfaces):
    """control_msgs, of this process and of others."""
    return ros_interfaces("control_msgs")


@pytest.fixture
def cell(interfaces, repository, harness, monkeypatch):
    """The graph of `test_primitive_activation`, its arm behind the action, however late it is."""
    monkeypatch.setattr(command_action, "ANSWER_S", np.inf)

    class Cell(Graph):
        """The commands are the goals."""

        def __init__(self):
            self.told = harness.collect(String, "told", 100)
            super().__init__(harness, command_action=ACTION, switch_lead=0.05)
            self.commands = []
            publish = self.node._action.publish

            def note(message):
                self.commands.append(copy.deepcopy(message))
                publish(message)

            self.node._action.publish = note
            self.node._output._commands = self.node._action
            harness.spin_until(self.node._action._client.server_is_ready, what="the controller")

        def answer(self, how):
            value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=how)
            request = SetParameters.Request(
                parameters=[ParameterMessage(name="answer", value=value)]
            )
            harness.call(SetParameters, "joint_trajectory_controller/set_parameters", request)

        def heard(self, what):
            return any(message.data == what for message in self.told)

    script = repository / "test" / "trajectory_controller.py"
    with NodeProcess(sys.executable, str(script)) as process:
        graph = Cell()
        graph.process = process
        yield graph


def test_goals_are_accepted_replaced_and_succeed(cell):
    cell.begin()
    cell.until(lambda: cell.mode == "homing")
    cell.until(lambda: cell.mode == "idle")
    cell.harness.spin_until(lambda: cell.heard("succeeded"), what="the last goal's result")
    assert len(cell.commands) > 2
    assert cell.node.activation.counts.keys().isdisjoint({"stopped: controller_aborted"})
    status, values = cell.report()
    assert status.level != bytes([Level.ERROR]) and "controller" not in status.message
    assert values["controller error [rad]"] == "0.020"


@pytest.mark.parametrize(
    ("how", "reason", "text"),
    [
        ("reject", "controller_rejected", "rejected a goal"),
        ("path", "controller_aborted", "path tolerance violated: joint 3"),
        ("silent", "controller_silent", "no answer"),
    ],
)
def test_a_goal_that_is_not_executed_ends_the_interaction(cell, monkeypatch, how, reason, text):
    monkeypatch.setattr(command_action, "ANSWER_S", 1.0 if how == "silent" else np.inf)
    cell.answer(how)
    cell.begin()
    cell.until(lambda: cell.rejected(reason))
    assert cell.mode == "idle" and cell.node.activation.active_task == ""
    status, _ = cell.report()
    assert status.level == bytes([Level.ERROR]) and text in status.message
    n_commands = len(cell.commands)
    cell.run(50)  # the same movement begins none anew
    assert len(cell.commands) == n_commands
    if how == "silent":
        cell.harness.spin_until(lambda: cell.heard("cancelled"), what="the late goal cancelled")
    cell.answer("accept")
    stand = cell.arm()
    cell.task = "idle"
    cell.run(50)
    cell.begin("screw")
    cell.until(lambda: cell.mode == "executing")
    np.testing.assert_allclose(cell.commands[-1].points[0].positions, stand, atol=0.05)
    cell.harness.spin_until(lambda: not cell.node._action.trouble, what="the goal accepted")


def test_a_goal_cancelled_by_others_ends_the_interaction(cell):
    cell.answer("hold")
    cell.begin()
    cell.until(lambda: cell.heard("accepted"))
    cell.harness.spin_until(lambda: cell.node._action._newest.handle, what="the newest accepted")
    cell.harness.call(CancelGoal, f"{ACTION}/_action/cancel_goal", CancelGoal.Request())
    cell.harness.spin_until(lambda: cell.rejected("controller_cancelled"), what="the result")
    assert cell.mode == "idle"


@pytest.mark.parametrize(
    ("status", "code", "reason"),
    [
        ("STATUS_CANCELED", "SUCCESSFUL", "controller_cancelled"),
        ("STATUS_ABORTED", "PATH_TOLERANCE_VIOLATED", "controller_aborted"),
    ],
)
def test_a_goal_that_ends_while_the_next_is_on_its_way_ends_the_interaction(
    cell, status, code, reason
):
    """Its result comes after the next goal was sent, which is cancelled, too."""
    cell.answer("hold")
    cell.begin()
    cell.until(lambda: cell.heard("accepted"))
    action = cell.node._action
    before, kind = action._newest, action._type.Result
    cell.until(lambda: action._newest is not before)
    update, result = action._newest, kind(error_code=getattr(kind, code))
    ended = SimpleNamespace(status=getattr(GoalStatus, status), result=result)
    action._on_result(before, SimpleNamespace(result=lambda: ended))
    assert cell.rejected(reason) and cell.mode == "idle"
    assert update.given_up
    cell.harness.spin_until(lambda: cell.heard("cancelled"), what="the update cancelled")


def test_who_commands_the_controller_by_its_topic_is_refused(cell):
    cell.harness.probe.create_publisher(
        JointTrajectory, "joint_trajectory_controller/joint_trajectory", 1
    )
    cell.harness.spin_until(lambda: cell.node._output.shared, what="who else commands")
    status, values = cell.report()
    assert status.level == bytes([Level.ERROR]) and "shared arm" in status.message
    assert values["rejected shared_arm"] == "1"


@pytest.mark.parametrize("late", [False, True])
def test_a_rejected_update_cancels_the_goal_under_way_or_once_it_is_accepted(cell, late):
    """Answers of a controller with several threads come in any order."""
    cell.answer("hold")
    action, accepted = cell.node._action, []
    answer = action._on_answer

    def keep_back(goal, future):
        if late and future.result().accepted:
            accepted.append((goal, future))
        else:
            answer(goal, future)

    action._on_answer = keep_back
    cell.begin()
    cell.until(lambda: accepted or cell.heard("accepted"))
    cell.answer("reject")
    cell.until(lambda: cell.rejected("controller_rejected"))
    for goal, future in accepted:
        answer(goal, future)
    cell.harness.spin_until(lambda: cell.heard("cancelled"), what="the goal cancelled")


def test_a_goal_tolerance_is_told_and_the_arm_goes_home(cell):
    cell.answer("hold")
    cell.begin()
    cell.until(lambda: cell.mode == "homing")
    cell.until(lambda: cell.mode == "idle")
    cell.answer("goal")
    cell.harness.spin_until(lambda: cell.heard("aborted"), what="the last goal aborted")
    cell.until(lambda: cell.rejected("goal_tolerance_violated"))
    assert "goal tolerance violated: joint 3" in cell.report()[0].message
    assert not any("controller" in reason for reason in cell.node.activation.counts)


def test_a_controller_that_is_gone_is_noticed(cell):
    cell.begin()
    cell.until(lambda: cell.heard("accepted"))
    cell.process.stop()
    cell.harness.spin_until(lambda: cell.rejected("controller_missing"), what="it is gone")
    assert cell.mode == "idle"


def test_without_control_msgs_the_node_says_what_to_install(harness, monkeypatch):
    monkeypatch.setitem(sys.modules, "control_msgs.action", None)
    with pytest.raises(ArgumentError, match="ros-jazzy-control-msgs"):
        Graph(harness, command_action=ACTION)

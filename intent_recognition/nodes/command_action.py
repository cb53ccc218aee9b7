# SPDX-License-Identifier: Apache-2.0
"""Commands as goals of a controller's action `control_msgs/action/FollowJointTrajectory`."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

from intent_recognition.errors import ArgumentError
from intent_recognition.nodes.diagnostics import Diagnostics
from intent_recognition.nodes.runtime import elapsed_s

ANSWER_S = 1.0
"""Time within which a controller must accept or reject a goal [s]: twenty periods of the action
monitor of ros2_control."""


@dataclass(eq=False)
class _Goal:
    """A goal that was sent, its handle once it is accepted, and whether we have cancelled it."""

    sent_s: float
    handle: Any = None
    given_up: bool = False

    def cancel(self) -> None:
        """Cancel the goal, now or once it is accepted."""
        self.given_up = True
        if self.handle is not None:
            self.handle.cancel_goal_async()


class CommandAction:
    """Sends each command as a goal, which replaces the one before.

    The command fails if the controller is gone or does not answer a goal within `ANSWER_S`, if the
    newest goal is rejected or aborted, or if any goal violates its path tolerance or is cancelled
    by another client. Then all goals under way are cancelled, so that the controller holds the
    arm, and `give_up` is called. Other ends of replaced goals are ignored; with ros2_control they
    have the code INVALID_GOAL, while a goal that a client cancelled has no code. A missed goal
    tolerance is only reported, since the arm is at rest near the end of its motion.

    Attributes:
        topic: topic on which the same controller takes commands, too.
        trouble: what is wrong with the newest command; empty if nothing is.

    Raises:
        ArgumentError: the package control_msgs is not installed.
    """

    def __init__(
        self, node: Node, name: str, diagnostics: Diagnostics, give_up: Callable[[str], object]
    ):
        try:
            from control_msgs.action import FollowJointTrajectory
        except ImportError as error:
            cure = "Install ros-jazzy-control-msgs, or leave command_action empty."
            expected = "control_msgs, which has the action's type"
            raise ArgumentError.about("command_action", expected, "none", cure) from error
        self._type = FollowJointTrajectory
        self._node, self._name = node, name
        self._diagnostics, self._give_up = diagnostics, give_up
        self._client = ActionClient(node, FollowJointTrajectory, name)
        self._newest: _Goal | None = None
        self._under_way: set[_Goal] = set()
        self.topic = "/".join([*name.split("/")[:-1], "joint_trajectory"])
        self.trouble = ""

    def publish(self, message: JointTrajectory) -> None:
        """Send a command."""
        if not self._client.server_is_ready():
            self._fail("controller_missing", f"no controller offers {self._name}")
            return
        goal = self._newest = _Goal(elapsed_s(self._node))
        self._under_way.add(goal)
        future = self._client.send_goal_async(
            self._type.Goal(trajectory=message), feedback_callback=partial(self._on_feedback, goal)
        )
        future.add_done_callback(partial(self._on_answer, goal))

    def check(self) -> None:
        """Detect a controller that is gone or silent; to be called several times a second."""
        if self._newest is None:
            return
        waiting = [goal.sent_s for goal in self._under_way if goal.handle is None]
        if not self._client.server_is_ready():
            self._fail("controller_missing", f"the controller of {self._name} is gone")
        elif waiting and elapsed_s(self._node) - min(waiting) > ANSWER_S:
            self._fail("controller_silent", f"no answer to a goal in {ANSWER_S:g} s")

    def _on_answer(self, goal: _Goal, future: Future) -> None:
        handle = future.result()
        if not handle.accepted:
            self._under_way.discard(goal)
            if goal is self._newest:
                self._fail("controller_rejected", f"{self._name} rejected a goal")
            return
        goal.handle = handle
        if goal.given_up:
            goal.cancel()
            return
        if goal is self._newest:
            self.trouble = ""
        handle.get_result_async().add_done_callback(partial(self._on_result, goal))

    def _on_feedback(self, goal: _Goal, message: Any) -> None:
        if goal is self._newest and message.feedback.error.positions:
            error = max(map(abs, message.feedback.error.positions))
            self._diagnostics.value("controller error [rad]", f"{error:.3f}")

    def _on_result(self, goal: _Goal, future: Future) -> None:
        status, result = future.result().status, future.result().result
        by_others = status == GoalStatus.STATUS_CANCELED
        self._under_way.discard(goal)
        if goal.given_up:
            return
        if goal is not self._newest:
            if by_others and result.error_code == self._type.Result.SUCCESSFUL:
                text = "a goal was cancelled by somebody else while the next one was on its way"
                self._fail("controller_cancelled", text)
            elif result.error_code == self._type.Result.PATH_TOLERANCE_VIOLATED:
                self._fail("controller_aborted", self._explain(result))
            return
        self._newest = None
        if status == GoalStatus.STATUS_SUCCEEDED:
            return
        why = self._explain(result)
        if result.error_code == self._type.Result.GOAL_TOLERANCE_VIOLATED:
            self.trouble = f"controller: {why}"
            self._diagnostics.reject("goal_tolerance_violated", why)
        elif by_others:
            self._fail("controller_cancelled", f"a goal was cancelled by somebody else: {why}")
        else:
            self._fail("controller_aborted", why)

    def _explain(self, result: Any) -> str:
        codes = {
            getattr(self._type.Result, name): name.lower().replace("_", " ")
            for name in ("INVALID_GOAL", "INVALID_JOINTS", "OLD_HEADER_TIMESTAMP")
            + ("PATH_TOLERANCE_VIOLATED", "GOAL_TOLERANCE_VIOLATED")
        }
        code = codes.get(result.error_code, f"error code {result.error_code}")
        return f"{code}: {result.error_string}" if result.error_string else code

    def _fail(self, reason: str, text: str) -> None:
        for goal in self._under_way:
            goal.cancel()
        self._under_way.clear()
        self._newest = None
        self.trouble = f"controller: {text}"
        self._diagnostics.reject(reason, text)
        self._give_up(reason)

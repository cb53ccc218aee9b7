# SPDX-License-Identifier: Apache-2.0
"""A controller with the action FollowJointTrajectory, as a process of its own.

Its parameter `answer` says what becomes of a goal: `accept`, `hold` (which does not end by itself),
`reject`, `silent` (accepted late), and of one that is executed: `path` or `goal` (the tolerance
that is violated). A newer goal takes the place of the one before. What it did is told on the topic
`told`.
"""

import contextlib
import signal
import sys
import time

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String

Result = FollowJointTrajectory.Result
TOLERANCES = {"path": Result.PATH_TOLERANCE_VIOLATED, "goal": Result.GOAL_TOLERANCE_VIOLATED}
LATE_S = 1.5


class TrajectoryController(Node):
    """Preempts as joint_trajectory_controller does: the newest goal is the active one."""

    def __init__(self):
        super().__init__("joint_trajectory_controller")
        self.declare_parameter("answer", "accept")
        self._newest = None
        self._told = self.create_publisher(String, "told", 100)
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            "~/follow_joint_trajectory",
            self._execute,
            goal_callback=self._accept,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    @property
    def answer(self):
        return self.get_parameter("answer").value

    def tell(self, text):
        self._told.publish(String(data=text))

    def _accept(self, goal):
        if self.answer == "silent":
            time.sleep(LATE_S)
        accepted = self.answer != "reject"
        self.tell("accepted" if accepted else "rejected")
        return GoalResponse.ACCEPT if accepted else GoalResponse.REJECT

    def _cancel(self, _):
        self.tell("asked to cancel")
        return CancelResponse.ACCEPT

    def _execute(self, handle):
        self._newest, holds = handle, self.answer == "hold"
        names = handle.request.trajectory.joint_names
        feedback = FollowJointTrajectory.Feedback(joint_names=names)
        feedback.error.positions = [0.01, -0.02]
        handle.publish_feedback(feedback)
        last = handle.request.trajectory.points[-1].time_from_start
        end_s = time.monotonic() + last.sec + last.nanosec * 1e-9
        while handle is self._newest and not handle.is_cancel_requested and self.answer != "path":
            over = not rclpy.ok() if holds else time.monotonic() > end_s
            if over:
                break
            time.sleep(0.005)
        if handle.is_cancel_requested:
            handle.canceled()
            self.tell("cancelled")
            return Result()
        if handle is not self._newest:
            handle.abort()
            return Result(error_string="replaced")
        if self.answer in TOLERANCES:
            handle.abort()
            self.tell("aborted")
            return Result(error_code=TOLERANCES[self.answer], error_string="joint 3")
        handle.succeed()
        self.tell("succeeded")
        return Result()


def main():
    # A KeyboardInterrupt that came while the executor's threads are told to end would leave them.
    signal.signal(signal.SIGINT, lambda *_: None)
    rclpy.init()  # whose own handler shuts the context down
    node, executor = TrajectoryController(), MultiThreadedExecutor(4)
    with contextlib.suppress(ExternalShutdownException):
        rclpy.spin(node, executor)
    return 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""A controller with the action FollowJointTrajectory, as a process of its own.

Its parameter `answer` says what becomes of a goal: `accept`, `hold` (which does not end by itself),
`reject`, `silent` (accepted late), and of one that is executed: `path` or `goal` (the tolerance
that is violated; `goal` ends a held one, too, after its time). A newer goal takes the place of the
one before. What it did is told on the topic `told`.
"""

import contextlib
import sys
import time
from functools import partial

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import String

Result = FollowJointTrajectory.Result
TOLERANCES = {"path": Result.PATH_TOLERANCE_VIOLATED, "goal": Result.GOAL_TOLERANCE_VIOLATED}
LATE_S = 1.5


class TrajectoryController(Node):
    """Preempts as joint_trajectory_controller does: the newest goal is the active one.

    In one thread: those of an executor may wait for ever for one another when a signal ends it.
    """

    def __init__(self):
        super().__init__("joint_trajectory_controller")
        self.declare_parameter("answer", "accept")
        self._under_way = []
        self._told = self.create_publisher(String, "told", 100)
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            "~/follow_joint_trajectory",
            self._succeeded,  # or what `_step` executes
            goal_callback=self._accept,
            handle_accepted_callback=self._begin,
            cancel_callback=self._cancel,
        )
        self.create_timer(0.005, self._step)

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

    def _begin(self, handle):
        names = handle.request.trajectory.joint_names
        feedback = FollowJointTrajectory.Feedback(joint_names=names)
        feedback.error.positions = [0.01, -0.02]
        handle.publish_feedback(feedback)
        last = handle.request.trajectory.points[-1].time_from_start
        end_s = time.monotonic() + last.sec + last.nanosec * 1e-9
        self._under_way.append((handle, end_s, self.answer == "hold"))

    def _step(self):
        newest = self._under_way[-1:]
        for goal in list(self._under_way):
            handle, end_s, held = goal
            if handle.is_cancel_requested:
                end = self._cancelled
            elif goal not in newest:
                end = self._replaced
            elif self.answer == "path":
                end = partial(self._violated, "path")
            elif time.monotonic() < end_s or (held and self.answer != "goal"):
                continue
            else:
                end = partial(self._violated, "goal") if self.answer == "goal" else self._succeeded
            self._under_way.remove(goal)
            handle.execute(end)

    def _cancelled(self, handle):
        handle.canceled()
        self.tell("cancelled")
        return Result()

    def _replaced(self, handle):
        handle.abort()
        return Result(error_string="replaced")

    def _violated(self, tolerance, handle):
        handle.abort()
        self.tell("aborted")
        return Result(error_code=TOLERANCES[tolerance], error_string="joint 3")

    def _succeeded(self, handle):
        handle.succeed()
        self.tell("succeeded")
        return Result()


def main():
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(TrajectoryController())
    return 0


if __name__ == "__main__":
    sys.exit(main())

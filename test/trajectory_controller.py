# SPDX-License-Identifier: Apache-2.0
"""A controller with the action FollowJointTrajectory, as a process of its own.

A newer goal takes the place of the one before.
"""

import contextlib
import sys
import time

import rclpy
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node

Result = FollowJointTrajectory.Result


class TrajectoryController(Node):
    """Preempts as joint_trajectory_controller does: the newest goal is the active one.

    In one thread: those of an executor may wait for ever for one another when a signal ends it.
    """

    def __init__(self):
        super().__init__("joint_trajectory_controller")
        self._under_way = []
        self._server = ActionServer(
            self,
            FollowJointTrajectory,
            "~/follow_joint_trajectory",
            self._succeeded,  # or what `_step` executes
            handle_accepted_callback=self._begin,
        )
        self.create_timer(0.005, self._step)

    def _begin(self, handle):
        names = handle.request.trajectory.joint_names
        feedback = FollowJointTrajectory.Feedback(joint_names=names)
        feedback.error.positions = [0.01, -0.02]
        handle.publish_feedback(feedback)
        last = handle.request.trajectory.points[-1].time_from_start
        self._under_way.append((handle, time.monotonic() + last.sec + last.nanosec * 1e-9))

    def _step(self):
        newest = self._under_way[-1:]
        for goal in list(self._under_way):
            handle, end_s = goal
            if goal not in newest or time.monotonic() > end_s:
                self._under_way.remove(goal)
                handle.execute(self._succeeded if goal in newest else self._replaced)

    def _replaced(self, handle):
        handle.abort()
        return Result(error_code=Result.INVALID_GOAL, error_string="replaced")

    def _succeeded(self, handle):
        handle.succeed()
        return Result()


def main():
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(TrajectoryController())
    return 0


if __name__ == "__main__":
    sys.exit(main())

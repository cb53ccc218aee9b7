# SPDX-License-Identifier: Apache-2.0
"""A real tracker and a real arm behind ros2_control's joint_trajectory_controller.

ros2 launch intent_recognition real.launch.py model:=bracket.npz params_file:=my_arm.yaml

Read docs/real_arm.md first. The tracker must publish mocap/<body>/pose, and the arm's own bring-up
its joint states and robot_description. The arm does not move before these transitions:
ros2 lifecycle set /primitive_activation configure, then activate.
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph


def generate_launch_description() -> LaunchDescription:
    return describe_graph("real")

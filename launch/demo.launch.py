# SPDX-License-Identifier: Apache-2.0
"""Recognition and simulation together, with quick discovery; `intent demo` also scores it.

ros2 launch intent_recognition demo.launch.py model:=toolbox.npz dashboard:=true rviz:=true
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.arm import describe_robot


def generate_launch_description() -> LaunchDescription:
    return describe_graph("demo", robot_description=describe_robot)

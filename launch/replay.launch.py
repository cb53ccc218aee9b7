# SPDX-License-Identifier: Apache-2.0
"""Play a recording to the recognition nodes, in recorded time; no arm moves.

ros2 launch intent_recognition replay.launch.py bag:=session model:=toolbox.npz rviz:=true
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.arm import describe_robot


def generate_launch_description() -> LaunchDescription:
    return describe_graph("replay", robot_description=describe_robot)

# SPDX-License-Identifier: Apache-2.0
"""The simulated arm with a cup of balls in its hand; the topic `pour` says how much to pour.

ros2 launch intent_recognition pouring.launch.py cup:=mug second:=tumbler
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.arm import describe_robot


def generate_launch_description() -> LaunchDescription:
    return describe_graph("pouring", robot_description=describe_robot)

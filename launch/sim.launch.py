# SPDX-License-Identifier: Apache-2.0
"""The physical side in simulation: the PyBullet arm and the simulated coworker.

ros2 launch intent_recognition sim.launch.py headless:=false
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.arm import describe_robot


def generate_launch_description() -> LaunchDescription:
    return describe_graph("sim", robot_description=describe_robot)

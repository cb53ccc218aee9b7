# SPDX-License-Identifier: Apache-2.0
"""Assembly by two people: an arm takes the place of the second, the first is simulated.

ros2 launch intent_recognition assembly.launch.py model:=two_humans.npz arm:=iiwa rviz:=true
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.arm import describe_robot
from sim_bridge.scenarios.assembly import in_assistants_place


def generate_launch_description() -> LaunchDescription:
    return describe_graph("assembly", robot_description=describe_robot, of_arm=in_assistants_place)

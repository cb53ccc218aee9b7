# SPDX-License-Identifier: Apache-2.0
"""Recognition and simulation together, with quick discovery; `intent demo` also scores a session.

Objects are handed over by force; `transfers:=false` leaves hands empty.

ros2 launch intent_recognition demo.launch.py model:=toolbox.npz dashboard:=true rviz:=true
"""

from launch import LaunchDescription

from intent_recognition.nodes.launching import describe_graph
from sim_bridge.scenarios.toolbox import describe_with_fingers, handing_over


def generate_launch_description() -> LaunchDescription:
    return describe_graph("demo", robot_description=describe_with_fingers, of_arm=handing_over)

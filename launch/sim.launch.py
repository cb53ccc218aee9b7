# SPDX-License-Identifier: Apache-2.0
"""The physical side in simulation: the PyBullet arm and the simulated coworker.

ros2 launch intent_recognition sim.launch.py headless:=false
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "intent_recognition"


def generate_launch_description():
    """Describe the two nodes and their arguments."""
    share = FindPackageShare(PACKAGE)

    def typed(name, value_type):
        return ParameterValue(LaunchConfiguration(name), value_type=value_type)

    common = {
        "package": PACKAGE,
        "namespace": LaunchConfiguration("namespace"),
        "output": "screen",
    }
    params_file = LaunchConfiguration("params_file")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "params.yaml"]),
                description="Parameters of all nodes.",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="Namespace of the nodes."
            ),
            DeclareLaunchArgument(
                "use_sim_time",
                default_value="false",
                description="Take the time from /clock, the arm's own (publish_clock) or another.",
            ),
            DeclareLaunchArgument(
                "publish_clock", default_value="false", description="The arm publishes /clock."
            ),
            DeclareLaunchArgument(
                "headless", default_value="true", description="No PyBullet window."
            ),
            DeclareLaunchArgument(
                "coworker", default_value="true", description="Start the simulated coworker."
            ),
            DeclareLaunchArgument(
                "seed", default_value="1", description="Seed of the coworker's movements."
            ),
            Node(
                executable="lwr_sim",
                name="lwr_sim",
                parameters=[
                    params_file,
                    {
                        "headless": typed("headless", bool),
                        "publish_clock": typed("publish_clock", bool),
                        "use_sim_time": typed("use_sim_time", bool),
                    },
                ],
                **common,
            ),
            Node(
                executable="coworker_sim",
                name="coworker_sim",
                parameters=[
                    params_file,
                    {"use_sim_time": typed("use_sim_time", bool), "seed": typed("seed", int)},
                ],
                condition=IfCondition(LaunchConfiguration("coworker")),
                **common,
            ),
        ]
    )

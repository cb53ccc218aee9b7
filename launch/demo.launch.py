# SPDX-License-Identifier: Apache-2.0
"""Recognition and simulation together, with quick discovery; `intent demo` also scores it.

ros2 launch intent_recognition demo.launch.py model:=toolbox.npz
"""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    SetEnvironmentVariable,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

SHARED = ("params_file", "namespace", "use_sim_time")


def generate_launch_description():
    """Include the two other launch files with the arguments they share."""
    share = FindPackageShare("intent_recognition")
    profiles = PathJoinSubstitution([share, "config", "fastdds.xml"])

    def include(name, *arguments):
        return IncludeLaunchDescription(
            PythonLaunchDescriptionSource(PathJoinSubstitution([share, "launch", name])),
            launch_arguments={
                argument: LaunchConfiguration(argument) for argument in (*SHARED, *arguments)
            }.items(),
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument("model", description="Model file written by `intent train`."),
            DeclareLaunchArgument(
                "dofs",
                default_value="",
                description="DOF file to check the model against; empty takes the model's own.",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=PathJoinSubstitution([share, "config", "params.yaml"]),
                description="Parameters of all nodes.",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="", description="Namespace of the nodes."
            ),
            DeclareLaunchArgument(
                "use_sim_time", default_value="false", description="Take the time from /clock."
            ),
            DeclareLaunchArgument(
                "publish_clock", default_value="false", description="The arm publishes /clock."
            ),
            DeclareLaunchArgument(
                "headless", default_value="true", description="No PyBullet window."
            ),
            DeclareLaunchArgument(
                "seed", default_value="1", description="Seed of the coworker's movements."
            ),
            # Jazzy's Fast DDS reads the first name, later ones the second.
            SetEnvironmentVariable("FASTRTPS_DEFAULT_PROFILES_FILE", profiles),
            SetEnvironmentVariable("FASTDDS_DEFAULT_PROFILES_FILE", profiles),
            include("intent.launch.py", "model", "dofs"),
            include("sim.launch.py", "publish_clock", "headless", "seed"),
        ]
    )

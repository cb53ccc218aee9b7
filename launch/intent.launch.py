# SPDX-License-Identifier: Apache-2.0
"""The recognition side: mocap_ingest, intent_estimator and primitive_activation.

ros2 launch intent_recognition intent.launch.py model:=toolbox.npz
For a real arm remap the command: command_topic:=/joint_trajectory_controller/joint_trajectory.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = "intent_recognition"


def generate_launch_description():
    """Describe the three nodes and their arguments."""
    share = FindPackageShare(PACKAGE)
    use_sim_time = ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)
    model = ParameterValue(LaunchConfiguration("model"), value_type=str)
    dofs = ParameterValue(LaunchConfiguration("dofs"), value_type=str)
    common = {
        "package": PACKAGE,
        "namespace": LaunchConfiguration("namespace"),
        "output": "screen",
    }
    params_file = LaunchConfiguration("params_file")
    remappings = [
        ("joint_trajectory", LaunchConfiguration("command_topic")),
        ("joint_states", LaunchConfiguration("joint_states_topic")),
    ]
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
                "command_topic",
                default_value="joint_trajectory",
                description="Where the arm takes a JointTrajectory.",
            ),
            DeclareLaunchArgument(
                "joint_states_topic",
                default_value="joint_states",
                description="Where the arm publishes its joint states.",
            ),
            Node(
                executable="mocap_ingest",
                name="mocap_ingest",
                parameters=[params_file, {"use_sim_time": use_sim_time}],
                **common,
            ),
            Node(
                executable="intent_estimator",
                name="intent_estimator",
                parameters=[
                    params_file,
                    {"use_sim_time": use_sim_time, "model": model, "dofs": dofs},
                ],
                remappings=remappings,
                **common,
            ),
            Node(
                executable="primitive_activation",
                name="primitive_activation",
                parameters=[params_file, {"use_sim_time": use_sim_time, "model": model}],
                remappings=remappings,
                **common,
            ),
        ]
    )

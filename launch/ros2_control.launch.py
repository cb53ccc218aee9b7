# SPDX-License-Identifier: Apache-2.0
"""ros2_control with mock hardware, and our graph, which commands its controller by the action.

ros2 launch intent_recognition ros2_control.launch.py arm:=panda model:=panda.npz

See docs/ros2_control.md. The other arguments of real.launch.py can be given, too.
"""

import sys

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from intent_recognition.nodes.graph import GRAPHS
from intent_recognition.nodes.launch_checks import check_arguments, check_package
from intent_recognition.nodes.launching import end_if_refused
from intent_recognition.share import share_path
from sim_bridge.arm import describe_robot

ACTION = {"command_action": "joint_trajectory_controller/follow_joint_trajectory"}
CONTROLLERS = ("joint_state_broadcaster", "joint_trajectory_controller")


def generate_launch_description() -> LaunchDescription:
    arm = DeclareLaunchArgument("arm", default_value="lwr", choices=["lwr", "panda"])
    graph = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(share_path("launch/real.launch.py"))),
        launch_arguments=ACTION.items(),
    )
    check, controllers = OpaqueFunction(function=_check), OpaqueFunction(function=_controllers)
    return LaunchDescription([arm, check, graph, controllers])


def _check(_: LaunchContext) -> list[Node]:
    """Refuse arguments and missing packages before any node starts; the graph checks its own."""
    graph_takes = {argument.name for argument in GRAPHS["real"].arguments()} - {*ACTION}
    check_arguments("ros2_control", ["arm", *sorted(graph_takes)], sys.argv)
    for package in ("controller_manager", "robot_state_publisher", *CONTROLLERS):
        check_package(package, "ros2_control.launch.py")
    return []


def _controllers(context: LaunchContext) -> list[Node]:
    arm = LaunchConfiguration("arm").perform(context)
    namespace = LaunchConfiguration("namespace").perform(context).strip("/")
    hardware = share_path(f"config/ros2_control/{arm}.ros2_control.xml").read_text(encoding="utf-8")
    described = describe_robot(arm).replace("</robot>", f"{hardware}</robot>")
    controllers = str(share_path(f"config/ros2_control/{arm}_controllers.yaml"))
    manager = Node(
        package="controller_manager",
        executable="ros2_control_node",
        name="controller_manager",
        namespace=namespace,
        parameters=[controllers],
        remappings=[("~/robot_description", "robot_description")],
        output="screen",
        on_exit=end_if_refused,
    )
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        namespace=namespace,
        parameters=[{"robot_description": described}],
        output="screen",
        on_exit=end_if_refused,
    )
    spawner = Node(
        package="controller_manager",
        executable="spawner",
        namespace=namespace,
        arguments=[*CONTROLLERS, "--controller-manager", "controller_manager"],
        output="screen",
        on_exit=end_if_refused,
    )
    return [manager, publisher, spawner]

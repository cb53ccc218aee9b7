# SPDX-License-Identifier: Apache-2.0
"""ros2_control with mock hardware, and our graph that drives its controller by the action.

ros2 launch intent_recognition ros2_control.launch.py arm:=panda model:=panda.npz

See docs/ros2_control.md. All arguments of real.launch.py can be given, too.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from intent_recognition.share import share_path
from sim_bridge.arm import describe_robot

CONTROLLERS = ("joint_state_broadcaster", "joint_trajectory_controller")


def generate_launch_description() -> LaunchDescription:
    arm = DeclareLaunchArgument("arm", default_value="lwr", choices=["lwr", "panda"])
    graph = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(str(share_path("launch/real.launch.py"))),
        launch_arguments={
            "command_action": "joint_trajectory_controller/follow_joint_trajectory"
        }.items(),
    )
    return LaunchDescription([arm, OpaqueFunction(function=_controllers), graph])


def _controllers(context: LaunchContext) -> list[Node]:
    arm = LaunchConfiguration("arm").perform(context)
    hardware = share_path(f"config/ros2_control/{arm}.ros2_control.xml").read_text(encoding="utf-8")
    described = describe_robot(arm).replace("</robot>", f"{hardware}</robot>")
    controllers = str(share_path(f"config/ros2_control/{arm}_controllers.yaml"))
    manager = Node(
        package="controller_manager",
        executable="ros2_control_node",
        name="controller_manager",
        parameters=[controllers],
        remappings=[("~/robot_description", "robot_description")],
        output="screen",
    )
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        parameters=[{"robot_description": described}],
        output="screen",
    )
    spawner = Node(
        package="controller_manager",
        executable="spawner",
        arguments=[*CONTROLLERS, "--controller-manager", "controller_manager"],
        output="screen",
    )
    return [manager, publisher, spawner]

"""Closed loop of simulator, identifier, controller and monitor from one parameter file.

Needs a full ROS 2 installation (`ros2 launch` has no wheels):

    ros2 launch spacerobot_ros closed_loop.launch.py params_file:=/path/to/robot.yaml

The simulator owns the clock, the others run on it. The controller is a lifecycle node that
configures and activates itself; with `autostart:=false` it waits for
`ros2 lifecycle set /controller configure`.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'spacerobot_ros'


def generate_launch_description() -> LaunchDescription:
    """Return the four nodes."""
    default_params = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'servicer.yaml'])
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=default_params,
                description='ROS 2 parameter file of robot, sensors, truth and gains.',
            ),
            DeclareLaunchArgument(
                'autostart',
                default_value='true',
                description='Whether the controller configures and activates itself.',
            ),
            part('simulator'),
            part('identifier', {'use_sim_time': True}),
            part('monitor', {'use_sim_time': True}),
            part(
                'controller',
                {
                    'use_sim_time': True,
                    'autostart': ParameterValue(LaunchConfiguration('autostart'), value_type=bool),
                },
            ),
        ]
    )


def part(name: str, *parameters: dict[str, object]) -> Node:
    """Return one node of the package, with the common parameter file and its own parameters."""
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        parameters=[LaunchConfiguration('params_file'), *parameters],
        output='screen',
    )

"""Closed loop of simulator, identifier, controller and monitor from one parameter file.

Needs a full ROS 2 installation (`ros2 launch` has no wheels):

    ros2 launch spacerobot_ros closed_loop.launch.py params_file:=/path/to/robot.yaml

The simulator owns the clock, the others run on it. All are lifecycle nodes that configure and
activate themselves; with `autostart:=false` the controller waits for
`ros2 lifecycle set /controller configure`. With `rviz:=true` the robot is shown: its links are
frames of robot_state_publisher, its base one of the simulator.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'spacerobot_ros'


def generate_launch_description() -> LaunchDescription:
    """Return the four nodes."""
    config = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config'])
    default_params = PathJoinSubstitution([config, 'servicer.yaml'])
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
            DeclareLaunchArgument('rviz', default_value='false', description='Show the robot.'),
            DeclareLaunchArgument(
                'urdf',
                default_value=PathJoinSubstitution([config, 'servicer.urdf']),
                description='URDF to show; that of params_file.',
            ),
            part('simulator'),
            part('identifier', {'use_sim_time': True, 'scheduling': 'nice'}),
            part('monitor', {'use_sim_time': True, 'scheduling': 'nice'}),
            part(
                'controller',
                {
                    'use_sim_time': True,
                    'scheduling': 'fifo',
                    'autostart': ParameterValue(LaunchConfiguration('autostart'), value_type=bool),
                },
            ),
            *view(config),
        ]
    )


def view(config: PathJoinSubstitution) -> list[Node]:
    """Return what shows the robot."""
    urdf = ParameterValue(Command(['cat ', LaunchConfiguration('urdf')]), value_type=str)
    simulated, is_shown = {'use_sim_time': True}, IfCondition(LaunchConfiguration('rviz'))
    return [
        Node(
            package='robot_state_publisher',
            executable='robot_state_publisher',
            parameters=[{'robot_description': urdf}, simulated],
            remappings=[('robot_description', 'robot_description_shown')],
            condition=is_shown,
        ),
        Node(
            package='rviz2',
            executable='rviz2',
            arguments=['-d', PathJoinSubstitution([config, 'views', 'spacerobot.rviz'])],
            parameters=[simulated],
            condition=is_shown,
        ),
    ]


def part(name: str, *parameters: dict[str, object]) -> Node:
    """Return one node of the package, with the common parameter file and its own parameters."""
    return Node(
        package=PACKAGE,
        executable=name,
        name=name,
        parameters=[LaunchConfiguration('params_file'), *parameters],
        output='screen',
    )

"""Closed loop of simulator, identifier and controller from one parameter file.

Needs a full ROS 2 installation (`ros2 launch` has no wheels):

    ros2 launch spacerobot_ros closed_loop.launch.py params_file:=/path/to/robot.yaml

The simulator owns the clock, the other two run on it. The controller is a lifecycle node: it is
configured at once and activated as soon as it is inactive for the first time.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode, Node
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition

PACKAGE = 'spacerobot_ros'


def generate_launch_description() -> LaunchDescription:
    """Return the three nodes and the controller's way to `active`."""
    default_params = PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'servicer.yaml'])
    params_file = LaunchConfiguration('params_file')
    on_sim_time = [params_file, {'use_sim_time': True}]

    simulator = Node(
        package=PACKAGE,
        executable='simulator',
        name='simulator',
        parameters=[params_file],
        output='screen',
    )
    identifier = Node(
        package=PACKAGE,
        executable='identifier',
        name='identifier',
        parameters=on_sim_time,
        output='screen',
    )
    controller = LifecycleNode(
        package=PACKAGE,
        executable='controller',
        name='controller',
        namespace='',
        parameters=on_sim_time,
        output='screen',
    )
    activate_when_configured = RegisterEventHandler(
        OnStateTransition(
            target_lifecycle_node=controller,
            start_state='configuring',
            goal_state='inactive',
            entities=[change_state(controller, Transition.TRANSITION_ACTIVATE)],
        )
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'params_file',
                default_value=default_params,
                description='ROS 2 parameter file of robot, sensors, truth and gains.',
            ),
            activate_when_configured,
            simulator,
            identifier,
            controller,
            change_state(controller, Transition.TRANSITION_CONFIGURE),
        ]
    )


def change_state(node: LifecycleNode, transition_id: int) -> EmitEvent:
    """Return the action that asks a lifecycle node for a transition."""
    return EmitEvent(
        event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition_id)
    )

"""FollowJointTrajectory on the closed loop; needs control_msgs, which the wheels do not have."""

import pytest

control_msgs = pytest.importorskip('control_msgs.action', reason='control_msgs is not installed')

from builtin_interfaces.msg import Duration  # noqa: E402
from control_msgs.action import FollowJointTrajectory  # noqa: E402
from control_msgs.msg import JointTolerance  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from spacerobot_ros.nodes.controller import ControllerNode  # noqa: E402
from spacerobot_ros.nodes.simulator import SimulatorNode  # noqa: E402

pytestmark = pytest.mark.ros
ABORTED, CANCELED, SUCCEEDED = 6, 5, 4
NAMES = ('joint_1', 'joint_2', 'joint_3')


@pytest.fixture
def arm(rig, servicer):
    """Return a loop that holds, and a client of its action."""
    known = {'robot.target_wheels.momentum': [42.0, 49.0, 41.0], 'reference.kind': 'hold'}
    parameters = {**servicer, **known}
    rig.controller = rig.add(ControllerNode, parameters)
    rig.simulator = rig.add(SimulatorNode, parameters)
    rig.client = ActionClient(
        rig.plain(), FollowJointTrajectory, '/controller/follow_joint_trajectory'
    )
    rig.until(lambda: rig.controller.last_command and rig.client.server_is_ready())
    return rig


def goal(
    seconds=1.0, position=(0.05, -0.05, 0.1), names=('joint_1', 'joint_2', 'joint_3'), **more
):
    end = Duration(sec=int(seconds), nanosec=round(seconds % 1 * 1e9))
    point = JointTrajectoryPoint(positions=list(position), time_from_start=end)
    trajectory = JointTrajectory(joint_names=list(names), points=[point])
    return FollowJointTrajectory.Goal(trajectory=trajectory, **more)


def send(arm, wanted, feedback=None):
    future = arm.client.send_goal_async(wanted, feedback_callback=feedback)
    arm.until(future.done)
    return future.result()


def result(arm, handle):
    future = handle.get_result_async()
    arm.until(future.done)
    return future.result()


def test_reaches_the_goal_and_says_how_it_goes(arm):
    seen = []
    tolerance = [JointTolerance(name='joint_1', position=1e-3)]
    handle = send(arm, goal(goal_tolerance=tolerance), seen.append)
    answer = result(arm, handle)
    assert (answer.status, answer.result.error_code) == (SUCCEEDED, 0), answer.result.error_string
    assert abs(arm.simulator.plant.state.q[0] - 0.05) < 1e-3
    assert len(seen) > 10
    assert list(seen[-1].feedback.joint_names) == ['joint_1', 'joint_2', 'joint_3']
    assert abs(seen[-1].feedback.actual.positions[0] - 0.05) < 0.01


@pytest.mark.parametrize(
    ('wanted', 'code', 'reason'),
    [
        (goal(names=('joint_1', 'joint_2', 'x')), -2, 'joint'),
        (goal(position=(1e6, 0.0, 0.0)), -1, 'joint_1 would move'),
        (goal(position=(float('nan'), 0.0, 0.0)), -1, 'finite'),
        (goal(path_tolerance=[JointTolerance(name='joint_1', position=1e-9)]), -4, 'joint_1'),
        (
            goal(
                goal_tolerance=[JointTolerance(name='joint_2', position=1e-9)],
                goal_time_tolerance=Duration(nanosec=100_000_000),
            ),
            -5,
            'joint_2',
        ),
    ],
)
def test_what_can_not_be_done_is_aborted_with_its_reason(arm, wanted, code, reason):
    answer = result(arm, send(arm, wanted))
    assert (answer.status, answer.result.error_code) == (ABORTED, code)
    assert reason in answer.result.error_string


def test_can_be_cancelled_replaced_and_stopped(arm):
    first = send(arm, goal(30.0))
    second = send(arm, goal(30.0))
    assert 'newer goal' in result(arm, first).result.error_string
    future = second.cancel_goal_async()
    arm.until(future.done)
    assert result(arm, second).status == CANCELED
    third = send(arm, goal(30.0))
    arm.controller.trigger_deactivate()
    assert 'deactivated' in result(arm, third).result.error_string
    answer = result(arm, send(arm, goal()))
    assert 'not active' in answer.result.error_string

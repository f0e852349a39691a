"""The action control_msgs/FollowJointTrajectory, by which MoveIt and others ask for motions."""

from __future__ import annotations

from typing import Any

import numpy as np
from rclpy.action import ActionServer, CancelResponse

from ..control.command import Command
from ..control.loop import ControlLoop
from ..control.waypoints import (
    INVALID_GOAL,
    INVALID_JOINTS,
    GoalEnd,
    Tolerances,
    TrajectoryGoal,
    Waypoints,
)
from ..errors import MessageRejectedError
from ..recording.messages import stamp_ns
from ..ros.convert import compose, doubles, message_type, trajectory
from .base import RobotNode

KIND = 'control_msgs/action/FollowJointTrajectory'
FEEDBACK_NS = 50_000_000


class TrajectoryAction:
    """Serves `~/follow_joint_trajectory`; one goal at a time, a newer one takes its place.

    Args:
        node: The controller.
        loop: Its loop.
        names: Of the joints.

    Raises:
        ImportError: control_msgs is not installed.
    """

    def __init__(self, node: RobotNode, loop: ControlLoop, names: list[str]) -> None:
        self._node, self._loop, self._names = node, loop, names
        self._kind = message_type(KIND)
        self._handle: Any = None
        self._goal: TrajectoryGoal | None = None
        self._fed_ns = 0
        self._server = ActionServer(
            node,
            self._kind,
            '~/follow_joint_trajectory',
            execute_callback=lambda _: None,
            handle_accepted_callback=self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def follow(self, command: Command) -> None:
        """Judge the goal by a command."""
        if self._handle is None or self._goal is None:
            return
        if self._handle.is_cancel_requested:
            self.stop('as asked for')
            return
        outcome = self._goal.judge(command, self._loop.time_left())
        if outcome is not None:
            if outcome.code:
                self._hold()
            self._end(outcome)
        elif not 0 <= command.stamp_ns - self._fed_ns < FEEDBACK_NS:
            self._fed_ns = command.stamp_ns
            self._handle.publish_feedback(self._feedback(command))

    def stop(self, why: str) -> None:
        """End the goal and hold."""
        if self._handle is not None:
            self._hold()
            self._end(GoalEnd(INVALID_GOAL, why))

    def replaced(self, why: str) -> None:
        """End the goal because another motion has taken its place."""
        if self._handle is not None:
            self._end(GoalEnd(INVALID_GOAL, why))

    def _on_goal(self, handle: Any) -> None:
        asked = handle.request
        try:
            if not self._node.is_active:
                raise MessageRejectedError('the controller is not active')
            if asked.multi_dof_trajectory.joint_names:
                raise MessageRejectedError('joints of several degrees of freedom: has none')
            path = Tolerances.of(asked.path_tolerance, self._names)
            goal = Tolerances.of(asked.goal_tolerance, self._names)
            patience = stamp_ns(asked.goal_time_tolerance) * 1e-9
            reference, start = trajectory(asked.trajectory, self._names, self._loop.setpoint())
            self._loop.set_reference(reference, start)
        except MessageRejectedError as error:
            self._node.health.reject('~/follow_joint_trajectory', error)
            is_joints = set(asked.trajectory.joint_names) != set(self._names)
            code = INVALID_JOINTS if is_joints else INVALID_GOAL
            self._conclude(handle, GoalEnd(code, str(error)))
            return
        self.replaced('a newer goal has taken its place')
        self._handle = handle
        units = {name: self._loop.robot.unit_of('rad', name) for name in self._names}
        self._goal = TrajectoryGoal(units, path, goal, patience)

    def _hold(self) -> None:
        """Come to rest where the motion is."""
        setpoint = self._loop.setpoint()
        if setpoint is not None:
            self._loop.set_reference(Waypoints(np.zeros(1), setpoint.q[None]))

    def _end(self, outcome: GoalEnd) -> None:
        handle, self._handle, self._goal = self._handle, None, None
        self._conclude(handle, outcome)

    def _conclude(self, handle: Any, outcome: GoalEnd) -> None:
        def give(handle: Any) -> Any:
            if handle.is_cancel_requested:
                handle.canceled()
            elif outcome.code:
                handle.abort()
            else:
                handle.succeed()
            return self._kind.Result(error_code=outcome.code, error_string=outcome.text)

        handle.execute(give)

    def _feedback(self, command: Command) -> Any:
        def point(**columns: Any) -> Any:
            content = {name: doubles(values) for name, values in columns.items()}
            return compose.make('trajectory_msgs/msg/JointTrajectoryPoint', **content)

        wanted, error, rate = command.setpoint, command.error, command.error_rate
        return self._kind.Feedback(
            header=compose.make('std_msgs/msg/Header', stamp=compose.time(command.stamp_ns)),
            joint_names=self._names,
            desired=point(positions=wanted.q, velocities=wanted.qd, accelerations=wanted.qdd),
            actual=point(positions=wanted.q - error, velocities=wanted.qd - rate),
            error=point(positions=error, velocities=rate),
        )

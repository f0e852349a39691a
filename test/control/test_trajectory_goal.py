"""Goals with tolerances: reached, late, or left on the way."""

from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.control.waypoints import (
    GOAL_TOLERANCE_VIOLATED,
    PATH_TOLERANCE_VIOLATED,
    SUCCESSFUL,
    Tolerances,
    TrajectoryGoal,
)
from spacerobot_ros.errors import MessageRejectedError

NAMES = ['a', 'b']


def tolerance(name, position=0.0, velocity=0.0):
    return SimpleNamespace(name=name, position=position, velocity=velocity)


def command(position, rate=(0.0, 0.0)):
    return SimpleNamespace(error=np.array(position), error_rate=np.array(rate))


def goal(path=(), end=(), patience=0.0):
    return TrajectoryGoal(
        dict.fromkeys(NAMES, 'rad'),
        Tolerances.of(path, NAMES),
        Tolerances.of(end, NAMES),
        patience,
    )


def test_without_tolerances_it_is_reached_when_its_time_is_over():
    judge = goal().judge
    assert judge(command([9.0, 9.0]), 0.01) is None
    assert judge(command([9.0, 9.0]), 0.0).code == SUCCESSFUL


def test_what_leaves_the_path_is_named_with_its_error():
    judge = goal([tolerance('b', 0.1, 2.0), tolerance('a', -1.0)]).judge
    assert judge(command([5.0, -0.09]), 1.0) is None
    outcome = judge(command([5.0, -0.11]), 1.0)
    assert outcome.code == PATH_TOLERANCE_VIOLATED
    assert outcome.text == 'b: position off by 0.11 rad, at most 0.1'
    assert judge(command([0.0, 0.0], [0.0, 2.1]), 1.0).text.startswith('b: rate off by 2.1')


@pytest.mark.parametrize(('patience', 'late'), [(0.0, None), (0.5, GOAL_TOLERANCE_VIOLATED)])
def test_the_end_is_waited_for(patience, late):
    judge = goal(end=[tolerance('a', 0.01)], patience=patience).judge
    assert judge(command([0.02, 9.0]), -0.4) is None
    outcome = judge(command([0.02, 9.0]), -0.6)
    assert (outcome and outcome.code) == late
    assert judge(command([0.005, 9.0]), -0.4).code == SUCCESSFUL


def test_unknown_joints_are_refused():
    with pytest.raises(MessageRejectedError, match='unknown joints: x'):
        Tolerances.of([tolerance('x')], NAMES)

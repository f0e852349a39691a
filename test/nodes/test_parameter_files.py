"""Parameter files of nodes: what rcl would take in silence is refused before the node is made."""

from __future__ import annotations

import pytest

pytest.importorskip('rclpy')
from spacerobot_ros.ros.run_node import run_nodes

pytestmark = pytest.mark.ros
TEXT = '/**:\n  ros__parameters:\n    robot: {gravity: [0.0, 0.0, 0.0]}\n'


def never():
    raise AssertionError


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        (TEXT + '    robot: {base: fixed}\n', "key 'robot' is given twice"),
        (TEXT + '    truth: ' + '[' * 100_000, 'more than 50 levels'),
        (TEXT + '    truth: !!int abc', "'abc' is no int"),
        (None, 'No such file'),
    ],
    ids=['twice', 'deep', 'tag', 'none'],
)
def test_a_parameter_file_is_checked(tmp_path, capsys, text, reason):
    path = tmp_path / 'robot.yaml'
    if text is not None:
        path.write_text(text)
    assert run_nodes([never], ['node', '--ros-args', '--params-file', str(path)]) == 2
    said = capsys.readouterr().err
    assert reason in said
    assert str(path) in said
    assert said.count('\n') == 1

"""Errors from another process are what they were there."""

from __future__ import annotations

import pickle

import pytest

from spacerobot_ros import errors


@pytest.mark.parametrize(
    'error',
    [
        errors.ConfigurationError('robot.urdf', 'is missing'),
        errors.ModelError('joint_1', 'turns about nothing'),
        errors.RecordingError('bag', 'is empty'),
        errors.MessageRejectedError('is not finite'),
        errors.IdentificationError('nothing moves'),
        errors.SimulationDivergedError(1.5, 'q is not finite'),
    ],
)
def test_errors_pass_between_processes(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)


def test_an_error_is_one_line_whatever_it_quotes():
    line = str(errors.ConfigurationError('robot.\x1b[31mred\n' + 'k' * 5000, 'got\0' + 'x' * 5000))
    assert line.startswith(r'robot.\x1b[31mred k')
    assert r'got\x00' in line
    assert line.isprintable()
    assert len(line) == 1000

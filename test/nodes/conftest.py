"""A rig a test, and the servicer's parameters; without ROS 2 only what needs none runs."""

import importlib.util
import warnings

import pytest

if importlib.util.find_spec('rclpy') and importlib.util.find_spec('spacerobot_msgs'):
    with warnings.catch_warnings():  # its parser generator uses a module that Python drops
        warnings.simplefilter('ignore', DeprecationWarning)
        import rosidl_generator_py  # noqa: F401
    from support.rig import Rig, file_parameters
else:
    collect_ignore = [
        f'test_{name}.py'
        for name in (
            'closed_loop', 'controller', 'convert', 'demo', 'free_flying', 'identifier',
            'monitor', 'parameters', 'simulator',
        )
    ]  # fmt: skip


@pytest.fixture
def rig():
    """Yield nodes in one process, in a context of their own."""
    rig = Rig()
    yield rig
    rig.close()


@pytest.fixture(scope='session')
def servicer():
    """Return the parameters of the servicer's robot file, in lockstep."""
    return {
        **file_parameters('config/servicer.yaml'),
        'simulator.lockstep': True,
        'use_sim_time': True,
    }

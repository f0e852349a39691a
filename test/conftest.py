"""What every test runs in: no discovery, no logs in the home folder, seeded randomness.

A test finds the process as it began, whatever ran before and whatever started the tests.

The environment is set before anything imports rclpy or numba, which read it once.
"""

import gc
import importlib.util
import os
import shutil
import signal
import tempfile

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'OFF'
os.environ['ROS_LOG_DIR'] = tempfile.mkdtemp(prefix='spacerobot-test-log-')
os.environ['MPLBACKEND'] = 'Agg'
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')  # as the package does
os.environ.pop('FORCE_COLOR', None)  # as services that run tests set it

import hypothesis
import numpy as np
import pytest

hypothesis.settings.register_profile('ci', derandomize=True, deadline=None, database=None)
hypothesis.settings.register_profile('dev', deadline=None)
hypothesis.settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'ci'))

# a job in the background of a script has Ctrl-C ignored, and so would processes of tests
signal.signal(signal.SIGINT, signal.default_int_handler)

HAS_ROS = all(importlib.util.find_spec(name) is not None for name in ('rclpy', 'spacerobot_msgs'))


def pytest_collection_modifyitems(items):
    """Skip tests marked `ros` where there is no ROS 2, so that the core's tests run anywhere."""
    if HAS_ROS:
        return
    skip = pytest.mark.skip(reason='no rclpy or no spacerobot_msgs: make test, or source env.sh')
    for item in items:
        if item.get_closest_marker('ros'):
            item.add_marker(skip)


def pytest_collection_finish():
    """What is imported and collected stays: the garbage collector need not look at it again."""
    gc.collect()
    gc.freeze()


def pytest_unconfigure():
    """Nothing is left of a session, nor of a process that shares one."""
    shutil.rmtree(os.environ['ROS_LOG_DIR'], ignore_errors=True)


@pytest.fixture(autouse=True)
def as_it_was():
    """Leave the process to the next test as this one found it."""
    environ, folder, collect = dict(os.environ), os.getcwd(), gc.isenabled()
    handlers = {k: signal.getsignal(k) for k in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)
    (gc.enable if collect else gc.disable)()
    os.chdir(folder)
    for name in os.environ.keys() - environ.keys():
        del os.environ[name]
    os.environ.update({k: v for k, v in environ.items() if os.environ.get(k) != v})


@pytest.fixture
def rng():
    """Return a random generator with the same seed in every test."""
    return np.random.default_rng(20240607)

"""How Fast DDS is set up, and that nodes hear programs that have it as it comes."""

import os
import subprocess
import sys
from contextlib import ExitStack

import pytest

from spacerobot_ros.ros import middleware
from spacerobot_ros.ros.middleware import RANGE, set_up_middleware
from validation.faults.process_loop import _own_domain

pytestmark = pytest.mark.ros

NAMES = tuple(middleware._OURS)
ANYWHERE, LOCALHOST = middleware._OURS['FASTDDS_DEFAULT_PROFILES_FILE']


def settings(monkeypatch, given, implementation='rmw_fastrtps_cpp'):
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(middleware, 'get_rmw_implementation_identifier', lambda: implementation)
    before = dict(os.environ)
    for _ in range(2):  # whoever asks again changes nothing
        set_up_middleware()
    return {name: value for name, value in os.environ.items() if before.get(name) != value}


@pytest.mark.parametrize('around', ['OFF', 'SUBNET', 'SYSTEM_DEFAULT'])
def test_the_range_stays_where_fast_dds_lets_transports_be_chosen(monkeypatch, around):
    changed = settings(monkeypatch, {RANGE: around})
    assert changed == {
        'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
        'FASTDDS_DEFAULT_PROFILES_FILE': ANYWHERE,
    }


def test_a_profile_describes_the_range_localhost(monkeypatch):
    changed = settings(monkeypatch, {RANGE: 'LOCALHOST'})
    assert changed == {
        RANGE: 'SYSTEM_DEFAULT',
        'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
        'FASTDDS_DEFAULT_PROFILES_FILE': LOCALHOST,
    }


def test_a_child_that_is_given_the_range_anew_gets_its_profile(monkeypatch):
    before = settings(monkeypatch, {RANGE: 'OFF'})
    assert settings(monkeypatch, {**before, RANGE: 'LOCALHOST'})[RANGE] == 'SYSTEM_DEFAULT'


@pytest.mark.parametrize('name', NAMES)
def test_what_a_user_has_chosen_stays(monkeypatch, name):
    assert settings(monkeypatch, {RANGE: 'LOCALHOST', name: 'mine'}) == {}


def test_another_middleware_is_left_alone(monkeypatch):
    assert settings(monkeypatch, {RANGE: 'LOCALHOST'}, 'rmw_cyclonedds_cpp') == {}


_HEARS = """
import select, sys
from pathlib import Path
from std_msgs.msg import String
def talk(node, said, awaited, spin):
    heard = []
    publisher = node.create_publisher(String, said, 10)
    node.create_subscription(String, awaited, heard.append, 10)
    node.create_timer(0.05, lambda: publisher.publish(String(data='word')))
    while not heard:
        spin()
    threads = {path.read_text() for path in Path('/proc/self/task').glob('*/comm')}
    shared = '/dev/shm/fastdds' in Path('/proc/self/maps').read_text()
    print(shared, 'dds.tls.request\\n' in threads, flush=True)
    while not select.select([sys.stdin], [], [], 0.0)[0]:  # the other has not heard yet
        spin()
"""
_OURS = """
from spacerobot_ros.ros.executor import spin_once
from spacerobot_ros.ros.session import Session
with Session() as session:
    node = session.plain('ours')
    talk(node, 'a', 'b', lambda: spin_once(session._executor, 0.05))
"""
_THEIRS = """
import rclpy
with rclpy.init():
    node = rclpy.create_node('theirs')
    talk(node, 'b', 'a', lambda: rclpy.spin_once(node, timeout_sec=0.05))
"""


def test_nodes_and_programs_that_use_shared_memory_hear_each_other(monkeypatch):
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)
    with _own_domain(), ExitStack() as stack:
        pipes = {'stdin': subprocess.PIPE, 'stdout': subprocess.PIPE}
        both = [
            subprocess.Popen([sys.executable, '-c', _HEARS + mine], **pipes)
            for mine in (_OURS, _THEIRS)
        ]
        for process in both:
            stack.enter_context(process)
            stack.callback(process.kill)  # where neither hears the other
        ours, theirs = (process.stdout.readline().split() for process in both)
        for process in both:
            process.communicate()
    assert ours == [b'False', b'False']
    assert theirs == [b'True', b'True']

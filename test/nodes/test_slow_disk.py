"""A disk that is slow or full: who asks for a file waits, messages and services do not."""

import errno
import threading
from dataclasses import replace

import numpy as np
import pytest
from spacerobot_msgs.msg import Estimate as EstimateMessage
from std_srvs.srv import Trigger
from support.bench import Bench
from support.free_flying import ROBOT_FILE, free_flying_parameters
from support.rig import Rig, file_parameters

from spacerobot_ros.identification.maximum_likelihood import Known
from spacerobot_ros.identification.online import OnlineIdentifier
from spacerobot_ros.identification.saved_knowledge import Knowledge
from spacerobot_ros.model import files
from spacerobot_ros.nodes import identifier as identifier_node
from spacerobot_ros.nodes.controller import ControllerNode
from spacerobot_ros.nodes.kept_file import KeptFile
from spacerobot_ros.ros.qos import LATCHED

pytestmark = pytest.mark.ros


class Disk:
    """Every file that is opened while it is slow waits until it goes on."""

    def __init__(self, patch):
        self.is_slow, self.full = False, None
        self.begun, self.go_on = threading.Semaphore(0), threading.Event()
        patch.setattr(files, 'open', self._open, raising=False)

    def _open(self, *args, **more):
        if self.is_slow:
            assert threading.current_thread() is not threading.main_thread()  # of callbacks
            self.begun.release()
            self.go_on.wait()
        if self.full is not None:
            raise self.full
        return open(*args, **more)


@pytest.fixture
def disk(monkeypatch):
    disk = Disk(monkeypatch)
    yield disk
    disk.go_on.set()


@pytest.fixture
def bench(rig, servicer, disk, monkeypatch, tmp_path):
    """An identifier that knows something, whatever it hears."""
    monkeypatch.setattr(identifier_node, 'ANSWER', None)  # the disk alone is slow
    more = {'simulator.lockstep': False, 'identifier.save_file': str(tmp_path / 'known.json')}
    bench = Bench(rig, servicer, **more)
    bench.path, identifier = tmp_path / 'known.json', bench.node.identifier
    part = slice(3, identifier.model.filter_bodies.stop)
    size = part.stop - part.start
    known = Known(part, identifier.model.prior(), np.eye(size), np.zeros(size))
    estimate = replace(identifier.solve(), valid=True, reason='')
    knowledge = Knowledge(identifier.model, known, estimate)
    monkeypatch.setattr(OnlineIdentifier, 'knowledge', property(lambda _: knowledge))
    return bench


def asked(probe, name):
    return probe.create_client(Trigger, name).call_async(Trigger.Request())


def test_what_is_saved_by_itself_delays_nothing(bench, disk):
    disk.is_slow = True
    bench.all(0, 1310)  # the first estimate is of 1 s
    bench.rig.until(lambda: disk.begun.acquire(blocking=False))
    bench.all(1310, 4000)
    assert len(bench.node.identifier.samples.streams['joints'].stamps) == 400
    bench.rig.until(lambda: len(bench.estimates) > 1)
    assert bench.call('/identifier/solve').message.startswith('not valid: only')
    assert bench.call('/identifier/reset').success
    assert not bench.path.exists()
    disk.go_on.set()
    bench.rig.until(bench.path.exists)


def test_what_is_learned_while_the_file_is_looked_for_is_saved_afterwards(bench, monkeypatch):
    found = threading.Event()
    monkeypatch.setattr(KeptFile, '_look', lambda _: (None, '' if found.wait() else 'never'))
    bench.all(0, 1310)
    bench.rig.until(lambda: bench.node.estimate)
    assert not bench.path.exists()
    found.set()
    bench.rig.until(bench.path.exists)


def test_who_asks_for_a_file_is_told_when_it_is_there_and_nobody_else_waits(bench, disk):
    disk.is_slow = True
    answer, other = asked(bench.probe, '/identifier/save'), asked(bench.probe, '/identifier/load')
    bench.rig.until(lambda: disk.begun.acquire(blocking=False))
    assert bench.call('/identifier/reset').success
    assert not answer.done()
    assert not other.done()
    assert not bench.path.exists()
    disk.go_on.set()
    bench.rig.until(answer.done)
    assert bench.path.exists()
    assert answer.result().success
    assert answer.result().message == f'saved to {bench.path}'
    bench.rig.until(other.done)
    assert other.result().success
    assert other.result().message == f'goes on with what {bench.path} knows'
    assert bench.node.estimate.valid


def test_a_node_that_starts_goes_on_while_it_reads_what_it_knows(servicer, bench, disk):
    assert bench.call('/identifier/save').success
    kept = bench.path.read_bytes()
    more = {'simulator.lockstep': False, 'identifier.save_file': str(bench.path)}
    other = Rig()
    try:
        again = Bench(other, servicer, **more)
        disk.is_slow = True  # its robot file was read without a callback that could wait
        other.until(lambda: disk.begun.acquire(blocking=False))
        again.all(0, 3000)
        assert again.call('/identifier/reset').success
        assert bench.path.read_bytes() == kept  # nothing newer takes its place unread
        assert not again.node.estimate.valid
        disk.go_on.set()
        other.until(lambda: again.node.estimate.valid)
    finally:
        other.close()


def test_a_full_disk_is_said_and_leaves_what_was_saved(bench, disk):
    assert bench.call('/identifier/save').success
    before = bench.path.read_bytes()
    disk.full = OSError(errno.ENOSPC, 'No space left on device')
    answer = bench.call('/identifier/save')
    assert not answer.success
    assert answer.message.startswith('not saved: ')
    assert answer.message.endswith('No space left on device')
    assert [p.name for p in bench.path.parent.iterdir()] == [bench.path.name]
    assert bench.path.read_bytes() == before
    disk.full = None
    assert bench.call('/identifier/save').success


def test_what_is_saved_once_more_does_not_pass_for_younger(bench):
    assert bench.call('/identifier/save').success
    before = bench.path.read_bytes()
    bench.path.unlink()
    assert bench.call('/identifier/save').success  # it says so when the file is there
    assert bench.path.read_bytes() == before


def test_a_controller_goes_on_while_it_saves(rig, disk, tmp_path):
    paths = tmp_path / 'robot.yaml', tmp_path / 'learned.json'
    parameters = file_parameters(ROBOT_FILE) | free_flying_parameters('adaptive_rls', 0.05)
    names = ('controller.save_parameters', 'controller.save_file')
    more = dict(zip(names, map(str, paths), strict=True))
    node, probe = rig.add(ControllerNode, parameters, **more), rig.plain()
    disk.is_slow = True
    answers = [asked(probe, f'/controller/{name}') for name in ('save_parameters', 'save')]
    for _ in answers:
        rig.until(lambda: disk.begun.acquire(blocking=False))
    probe.create_publisher(EstimateMessage, '/estimate', LATCHED).publish(EstimateMessage())
    rig.until(lambda: node._estimate_note == 'last one not valid: ')
    assert not any(answer.done() for answer in answers)
    disk.go_on.set()
    for answer, path in zip(answers, paths, strict=True):
        rig.until(answer.done)
        assert answer.result().success
        assert path.exists()

"""Solving beside the callbacks: whatever it takes, samples and services are answered at once."""

import threading

import numpy as np
import pytest
from support.bench import MS, Bench
from support.rig import Rig

from spacerobot_ros.identification import segment
from spacerobot_ros.identification.online import OnlineIdentifier
from spacerobot_ros.nodes.beside import Beside
from spacerobot_ros.recording import buffer
from spacerobot_ros.recording.buffer import SampleBuffer

pytestmark = pytest.mark.ros


@pytest.fixture
def slow(rig, servicer, monkeypatch):
    """Return a bench whose identifier solves only while `go` is set, and how often it did."""
    bench = Bench(rig, servicer, **{'simulator.lockstep': False})
    bench.begun, bench.go, solve = (
        threading.Semaphore(0),
        threading.Event(),
        OnlineIdentifier.solve,
    )

    def wait(identifier, until_ns=None):
        if threading.current_thread() is not threading.main_thread():
            bench.begun.release()
            bench.go.wait()
        return solve(identifier, until_ns)

    monkeypatch.setattr(OnlineIdentifier, 'solve', wait)
    yield bench
    bench.go.set()


def test_while_it_solves_samples_are_taken_and_services_answer(slow):
    slow.all(0, 1310)
    slow.begun.acquire()
    slow.all(1310, 9000)
    streams = slow.node.identifier.samples.streams
    assert len(streams['joints'].stamps) == 900
    response = slow.call('/identifier/solve')
    assert not response.success
    assert response.message == 'still solving; the last one: none yet'
    assert not slow.call('/identifier/save').success
    assert slow.estimates == []
    slow.go.set()
    slow.rig.until(lambda: slow.estimates)
    slow.gyro(9000)
    slow.joint(9000)
    slow.star(9000)
    slow.rig.until(lambda: len(slow.estimates) == 2)
    slow.rig.drain()
    # seven periods went by, whose estimates nobody would have been in time for
    assert len(slow.estimates) == 2
    assert slow.node.health.count() == 0


def test_reset_answers_while_it_solves_and_what_was_solved_is_dropped(slow):
    slow.all(0, 1310)
    slow.begun.acquire()
    assert slow.call('/identifier/reset').success
    slow.rig.until(lambda: len(slow.estimates) == 1)
    slow.go.set()
    slow.rig.until(lambda: not slow.node._beside.is_busy)
    slow.rig.drain()
    assert len(slow.estimates) == 1
    assert 'no' in slow.estimates[0].reason
    assert slow.node.identifier.samples.newest_ns is None


def test_what_fails_beside_the_callbacks_ends_the_node():
    rig = Rig()
    try:
        beside = Beside(rig.plain(), is_threaded=True)
        beside.start(lambda: [][0], lambda _: None)
        with pytest.raises(IndexError):
            rig.until(lambda: False)
        assert not beside.is_busy
    finally:
        rig.close()


def test_a_flood_fills_no_more_than_its_share_of_memory(monkeypatch):
    monkeypatch.setattr(buffer, 'MOST_SAMPLES', 1000)
    samples = SampleBuffer(('j',), lateness=0.5)
    for ns in range(0, 5_000 * MS, MS):
        samples.add_rate(ns, np.zeros(3))
    stamps = samples.streams['imu'].stamps
    assert 900 <= len(stamps) <= 1000
    assert stamps[-1] == 4_999 * MS
    assert len(samples.streams['imu'].values) == len(stamps)


def test_one_solution_takes_no_more_samples_than_its_share(rig, servicer, monkeypatch):
    monkeypatch.setattr(segment, '_LARGEST', 500)
    bench = Bench(rig, servicer)
    seen = []

    def note(self, record, end, newest):
        seen.append((self._segment.done, end))
        return self._nothing('only looked at')

    monkeypatch.setattr(OnlineIdentifier, '_solve', note)
    bench.all(0, 9000)
    seen.clear()
    bench.node.identifier.solve()
    assert seen == [(0.0, 5.0)]

"""Samples come out in the order of their stamps, whatever order they came in."""

import pytest

from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.ros.merge import Merger


def feed(merger, samples, now=0):
    return [out for stream, stamp in samples for out in merger.add(stream, stamp, None, now)]


def test_order_of_arrival_does_not_matter(rng):
    samples = [(0, 10 * k) for k in range(50)] + [(1, 10 * k) for k in range(50)]
    samples += [(2, 100 * k) for k in range(5)]
    want = sorted((stamp, stream) for stream, stamp in samples)
    for _ in range(20):
        # each message is late by up to 30, so neighbours overtake each other
        shuffled = sorted(samples, key=lambda s: s[1] + rng.uniform(0, 30))
        merger = Merger(3, 1000, slack_ns=40)
        got = feed(merger, shuffled) + merger.flush()
        assert [(stamp, stream) for stamp, stream, _ in got] == want


def test_a_stream_that_is_worked_off_slowly_is_waited_for():
    merger = Merger(2, 100)
    assert feed(merger, [(0, k) for k in range(0, 1000, 10)]) == []
    assert len(feed(merger, [(1, k) for k in range(0, 1000, 10)], now=99)) == 200


def test_a_silent_stream_is_not_waited_for():
    merger = Merger(2, 100)
    assert feed(merger, [(0, 0), (0, 50), (0, 150)]) == []
    assert [s[0] for s in feed(merger, [(0, 160)], now=101)] == [0, 50, 150, 160]


def test_late_and_duplicate_samples_are_rejected():
    merger = Merger(1, 100)
    feed(merger, [(0, 10)])
    with pytest.raises(MessageRejectedError, match='duplicate'):
        feed(merger, [(0, 10)])
    with pytest.raises(MessageRejectedError, match='too late'):
        feed(merger, [(0, 5)])


def test_content_stays_with_its_stamp():
    merger = Merger(2, 100)
    merger.add(0, 1, 'a', 0)
    assert merger.add(1, 1, 'b', 0) == [(1, 0, 'a'), (1, 1, 'b')]
    assert merger.newest == (1, 1)
    assert merger.flush() == []

"""A wrong stamp is refused, a clock that jumped is followed."""

import pytest

from spacerobot_ros.recording.clock_jumps import JumpDetector, Sample, refusal

S = 10**9
START = 1000 * S


def samples(first, count, sensors=('imu', 'joints'), period=S // 100):
    return [Sample(sensor, first + k * period, (k,)) for k in range(count) for sensor in sensors]


def play(detector, given, now_ns=None):
    """Taken and refused samples, and the jumps."""
    taken, refused, jumps = [], [], []
    for sample in given:
        judged = detector.judge(sample, lambda: now_ns)
        taken += judged.taken
        refused += judged.refused
        jumps += [] if judged.jump_ns is None else [judged.jump_ns]
    return taken, refused, jumps


@pytest.mark.parametrize('stamp', [0, START - 2 * S, START + 30 * S, (2**31 - 1) * S])
@pytest.mark.parametrize('count', [1, 3])
def test_wrong_stamps_are_refused(stamp, count):
    wrong = [Sample('imu', stamp + k, ()) for k in range(count)]
    right = [*samples(START, 3), *samples(START + S, 3)]
    assert play(JumpDetector(S), [*right[:6], *wrong, *right[6:]]) == (right, wrong, [])


@pytest.mark.parametrize('jump', [-2 * S, -START, 10 * S, 10**9 * S])
def test_a_clock_that_jumps_is_followed_without_loss(jump):
    given = [*samples(START, 5), *samples(START + jump, 5)]
    taken, refused, jumps = play(JumpDetector(S), given)
    assert (taken, refused) == (given, [])
    assert jumps == [jump - 4 * S // 100]


def test_a_first_stamp_that_is_wrong_is_left():
    wrong, right = Sample('imu', (2**31 - 1) * S, ()), samples(START, 5)
    taken, _, jumps = play(JumpDetector(S), [wrong, *right])
    assert taken == [wrong, *right]
    assert len(jumps) == 1


def test_a_clock_confirms_at_once():
    detector = JumpDetector(S)
    play(detector, samples(START, 5))
    (late,) = samples(5 * S, 1, ('joints',))
    assert detector.judge(late, lambda: START).taken == ()
    judged = detector.judge_held(lambda: 5 * S)
    assert judged.taken == (late,)
    assert judged.jump_ns < 0
    other = samples(10 * S, 1, ('joints',))[0]
    assert detector.judge(other, lambda: 10 * S).taken == (other,)


@pytest.mark.parametrize(('now_ns', 'is_run'), [(START, True), (START + S, False), (None, False)])
def test_a_clock_that_goes_back_a_little_begins_another_run(now_ns, is_run):
    detector, late = JumpDetector(S), samples(START, 1, ('joints',))[0]
    play(detector, samples(START, 5))
    assert detector.judge(late, lambda: now_ns).jump_ns is None  # one that is late, no more
    detector.hear_clock(-4 * S // 100)
    ahead = samples(START + 5 * S // 100, 1, ('imu',))[0]
    assert detector.judge(ahead, lambda: now_ns).jump_ns is None
    assert detector.judge(late, lambda: now_ns).jump_ns == (-4 * S // 100 if is_run else None)
    assert detector.judge(late, lambda: now_ns).jump_ns is None


def test_stamps_that_stand_still_confirm_nothing():
    detector, right = JumpDetector(S), samples(START, 5)
    stuck = [Sample('imu', 5 * S, ())] * 20
    taken, refused, jumps = play(detector, [*right, *stuck, *samples(START + S // 10, 1)])
    assert len(taken) == len(right) + 2
    assert len(refused) == 20
    assert jumps == []


def test_a_sensor_that_lags_is_no_jump():
    detector = JumpDetector(S)
    play(detector, samples(START, 5))
    assert detector.judge(Sample('attitude', START - 5 * S, ())).taken


def test_says_why():
    error = refusal(Sample('imu', START + 30 * S, ()), START)
    assert str(error) == 'stamp jumps by 30 s, and none agrees with it; check the clock'

"""The online identifier: agreement with the batch, honesty, life."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from support.identification import (
    ORIGIN_NS,
    SILENT,
    errors_of,
    measure,
    servicer,
    simulate,
    truth_of,
)
from support.models import H_TARGET, random_tree, robot_of
from support.online import (
    WRONG,
    assert_never_confidently_wrong,
    error_of,
    events,
    feed,
    half_minute,
    identifier,
    same,
    streams,
)

from spacerobot_ros.errors import ConfigurationError, MessageRejectedError
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.identification.online import OnlineIdentifier
from spacerobot_ros.model.settings import IdentifierSettings

NAN = np.array([0.0, np.nan, 0.0])
H = np.linalg.norm(H_TARGET)


def test_ends_where_the_batch_ends():
    run, _, estimates = half_minute()
    online = estimates[-1]
    assert online.valid
    error, std = errors_of(online, truth_of(run))
    assert np.max(np.abs(error / std)) <= 4.0
    assert 0.9 <= online.chi2_per_dof <= 1.1


@pytest.mark.parametrize('until', [10, 16, 24])
@pytest.mark.parametrize(('prior', 'apart'), [(1.0, 0.1), (WRONG, 0.25)])
def test_is_the_batch_up_to_its_stamp(prior, apart, until):
    # about a wrong file the rows of early stretches stay linearized further away
    data = measure(simulate('zyx', 30.0), 0)
    settings, robot = IdentifierSettings(structure='symmetric'), servicer('zyx', prior=prior)
    online = feed(OnlineIdentifier(robot, settings), data.between(-1.0, until), 1.0)[-1]
    batch = identify(
        data.between(-1.0, (online.stamp_ns - ORIGIN_NS) * 1e-9), robot, settings
    ).estimate
    assert online.samples == batch.samples == 100 * until - 49
    assert np.max(np.abs(online.aam - batch.aam) / batch.std[:3]) < apart
    np.testing.assert_allclose(online.std[:3], batch.std[:3], rtol=0.05, atol=0)


def test_becomes_valid_soon_and_better():
    run, _, estimates = half_minute()
    first = next(i for i, e in enumerate(estimates) if e.valid)
    assert first <= 10
    assert all(e.valid for e in estimates[first:])
    std = [np.max(e.std[:3]) for e in estimates[first:]]
    assert std[-1] < 0.1 * std[0]
    assert np.max(np.abs(error_of(estimates[-1], run)[0])) < 1.5e-3 * H


def test_valid_estimates_are_right():
    run, _, estimates = half_minute()
    assert_never_confidently_wrong(estimates, run)


@pytest.mark.parametrize(
    ('axes', 'seed'),
    [('zyx', 1), ('zyx', 2), ('xyy', 1), ('xyy', 0)],
)
def test_valid_estimates_are_right_for_other_noise_and_axes(axes, seed):
    run = simulate(axes, 16.0)
    estimates = feed(identifier(axes), measure(run, seed))
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid


def test_early_estimates_say_what_is_missing():
    estimates = half_minute()[2]
    assert not estimates[0].valid
    assert estimates[0].reason.startswith('only 0.')
    assert '4 s are needed' in estimates[0].reason
    assert all(bool(e.reason) != e.valid for e in estimates)
    assert set(estimates[-1].unexcited) <= {'base_link: mass'}
    assert 22 <= estimates[-1].rank < estimates[-1].unknowns == 32


def test_nothing_measured_yet():
    estimate = identifier().solve()
    assert not estimate.valid
    assert estimate.reason == 'no joint states and no gyro and no attitude yet'
    assert estimate.unexcited == ('everything',)
    assert set(estimate.sources) == {'file'}
    estimate.check()
    online = identifier()
    online.add_rate(5, np.zeros(3))
    assert online.solve().reason == 'no joint states and no attitude yet'


@cache
def poorly_excited(motion, prior=1.0):
    """Run and estimates of a motion that can not tell everything, solved once a second."""
    run, settings = simulate('zyx', 12.0, motion), IdentifierSettings()
    return run, feed(OnlineIdentifier(servicer('zyx', prior=prior), settings), measure(run, 0))


def test_resting_arm_is_one_rigid_body():
    # Six inertias of the whole and the sum of the wheels are all that a rigid body can tell; the
    # file's bodies and its own wheels tell the rest.
    last = poorly_excited('still')[1][-1]
    assert last.unexcited[-1].startswith('link_')
    assert 'link_1, link_2: mass, centre of mass, inertia' in last.unexcited
    assert last.rank <= 3 + 9 + 4
    assert np.max(last.std[:3]) > 5.0 * np.max(poorly_excited('last_joint_only')[1][-1].std[:3])


@pytest.mark.parametrize('prior', [1.0, WRONG])
@pytest.mark.parametrize('motion', ['still', 'last_joint_only'])
def test_unexcited_motion_is_not_confidently_wrong(motion, prior):
    run, estimates = poorly_excited(motion, prior)
    error, std = errors_of(estimates[-1], truth_of(run, 'generic'))
    assert np.max(np.abs(error / std)) <= 5.0
    assert estimates[-1].valid or prior == WRONG


def test_noise_levels_that_are_not_stated_are_said():
    run = simulate('zyx', 16.0)
    estimates = feed(identifier(sensors=SILENT), measure(run, 1))
    assert_never_confidently_wrong(estimates, run)
    said = [note.split()[0] for note in estimates[-1].notes if 'is not stated' in note]
    assert said == ['joint_position_std', 'joint_velocity_std', 'gyro_std', 'attitude_std']
    assert 0.85 <= estimates[-1].chi2_per_dof <= 1.15


def test_a_fixed_base_is_refused(rng):
    with pytest.raises(ConfigurationError, match='free base'):
        OnlineIdentifier(robot_of(random_tree(rng, [0]), base='fixed'), IdentifierSettings())


def test_reset_forgets_everything():
    _, data, estimates = half_minute()
    online = identifier()
    with pytest.raises(MessageRejectedError):
        online.add_rate(0, NAN)
    feed(online, data.between(-1.0, 9.0))
    online.reset()
    assert online.solve().reason == 'no joint states and no gyro and no attitude yet'
    again = feed(online, data.between(-1.0, 9.0), 1.0)  # the same stamps are new again
    for a, b in zip(again[:-1], estimates, strict=False):
        same(a, b)


def test_same_data_give_the_same_bits():
    _, data, estimates = half_minute()
    again = feed(identifier(), data.between(-1.0, 14.0), 1.0)  # valid from the tenth second on
    assert again[-2].valid
    for a, b in zip(again[:-1], estimates, strict=False):
        same(a, b)


def test_solving_twice_changes_nothing():
    _, data, _ = half_minute()
    online = identifier()
    first = feed(online, data.between(-1.0, 8.0))[-1]
    same(online.solve(), first)


def test_long_runs_keep_a_bounded_buffer():
    run = simulate('zyx', 60.0, 'still')
    data = measure(run, 0, joint_every=5, rate_every=5, attitude_every=20)
    online, longest, due = identifier(buffer=10.0), 0, 1.0
    for stamp, method, values in events(data):
        while (stamp - ORIGIN_NS) * 1e-9 > due + 1e-9:
            online.solve()
            due += 1.0
            longest = max(longest, *(len(s.stamps) for s in streams(online)))
        getattr(online, method)(stamp, *values)
    # ten seconds at 20 Hz, and a second or two between solutions
    assert longest <= 20 * 13
    assert max(len(s.stamps) for s in streams(online)) <= 20 * 5
    assert online.solve().samples == pytest.approx(20 * 59.5, abs=5)


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_accuracy_with_a_small_buffer(axes):
    run = simulate(axes, 40.0)
    estimates = feed(identifier(axes, buffer=12.0), measure(run, 9), period=2.0)
    assert_never_confidently_wrong(estimates, run)
    error, _ = error_of(estimates[-1], run)
    assert np.max(np.abs(error)) < 2e-3 * H


def test_rarely_solved():
    run = simulate('zyx', 30.0)
    estimates = feed(identifier(), measure(run, 10), period=10.0)
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid

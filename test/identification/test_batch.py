"""Identification of a record: the three methods and the refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.identification import (
    SILENT,
    errors_of,
    measure,
    servicer,
    simulate,
    truth_of,
)
from support.models import random_tree, robot_of

from spacerobot_ros.errors import ConfigurationError, IdentificationError
from spacerobot_ros.identification.batch import METHODS, identify
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries

SETTINGS = IdentifierSettings(structure='symmetric')


@pytest.fixture(scope='module')
def run():
    return simulate('zyx', 20.0)


@pytest.fixture(scope='module')
def record(run):
    return replace(measure(run, 3, attitude_every=1), source='somewhere/bag')


@pytest.mark.parametrize('method', METHODS)
def test_every_method_names_itself_and_fills_the_result(method, run, record):
    estimate = identify(record, servicer(), SETTINGS, method).estimate
    estimate.check()
    assert estimate.method == method
    assert estimate.aam_links == ('link_3',)
    assert len(estimate.parameters) == 19
    assert estimate.samples > 1900
    # the recursion keeps back what late samples may still change
    lag = 5 * 10**8 if method == 'recursive' else 0
    assert estimate.stamp_ns == 10**18 + 20 * 10**9 - lag
    assert np.isfinite(estimate.condition)
    plain = estimate.to_dict()
    assert plain['method'] == method
    assert len(plain['parameters']) == 19


def test_accuracy_of_the_methods(run, record):
    # Plain least squares is far off at this noise, maximum likelihood is not.
    errors = {}
    for method in METHODS:
        error, std = errors_of(
            identify(record, servicer(), SETTINGS, method).estimate, truth_of(run)
        )
        errors[method] = np.max(np.abs(error[3:6]))
        if method != 'ls':
            assert np.max(np.abs(error / std)) <= 4.0
    assert errors['ml'] < 0.03
    assert errors['recursive'] < 0.03
    assert errors['ls'] > 10.0 * errors['ml']


def test_the_default_is_maximum_likelihood(record):
    assert identify(record, servicer(), SETTINGS).estimate.method == 'ml'


@pytest.mark.parametrize('method', METHODS)
def test_data_without_noise(method, run):
    record = measure(run, 0, scale=0.0, attitude_every=1)
    estimate = identify(record, servicer(sensors=SILENT), SETTINGS, method).estimate
    error, _ = errors_of(estimate, truth_of(run))
    assert np.max(np.abs(error[3:6])) < 1e-4
    assert np.max(np.abs(error[6:])) < 1e-2  # of 5000 kg m^2


def test_same_record_same_bits(record):
    # of two robots, so that nothing that was found of the first serves the second
    a, b = (identify(record, replace(servicer()), SETTINGS).estimate for _ in range(2))
    np.testing.assert_array_equal(a.aam, b.aam)
    np.testing.assert_array_equal(a.covariance, b.covariance)


def test_notes_of_the_record_are_handed_on(record):
    estimate = identify(
        replace(record, notes=('two messages dropped',)), servicer(), SETTINGS
    ).estimate
    assert 'two messages dropped' in estimate.notes


def without(record, *names):
    return replace(record, **dict.fromkeys(names))


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize(
    ('missing', 'match'),
    [
        (('joints',), 'somewhere/bag: has no /joint_states$'),
        (('rates',), 'somewhere/bag: has no /imu/data$'),
        (('attitudes',), 'somewhere/bag: has no /attitude$'),
        (('joints', 'attitudes'), 'has no /joint_states, no /attitude$'),
    ],
)
def test_missing_sensors_are_named(record, method, missing, match):
    with pytest.raises(IdentificationError, match=match):
        identify(without(record, *missing), servicer(), SETTINGS, method)


@pytest.mark.parametrize('method', METHODS)
def test_too_short_a_record_is_refused(record, method):
    short = replace(
        record,
        joints=JointSeries(
            record.joints.names,
            record.joints.stamp_ns[:100],
            record.joints.position[:100],
            record.joints.velocity[:100],
        ),
        rates=RateSeries(record.rates.stamp_ns[:100], record.rates.omega[:100]),
        attitudes=AttitudeSeries(record.attitudes.stamp_ns[:10], record.attitudes.q_xyzw[:10]),
    )
    with pytest.raises(IdentificationError, match=r'somewhere/bag: 0\.99 s is too short'):
        identify(short, servicer(), SETTINGS, method)


def test_unknown_method_is_refused(record):
    with pytest.raises(IdentificationError, match=r"'kalman' is not one of ml, recursive, ls"):
        identify(record, servicer(), SETTINGS, 'kalman')


def test_robots_that_a_method_can_not_have_are_refused(record, rng):
    parts = random_tree(rng, [0, 1, 2], prismatic=(3,))
    with pytest.raises(ConfigurationError, match=r"joint 'j_link_3'.*slides.*use method `ml`$"):
        identify(record, robot_of(parts), SETTINGS, 'ls')
    with pytest.raises(ConfigurationError, match='free base'):
        identify(record, robot_of(random_tree(rng, [0, 1, 2]), base='fixed'), SETTINGS)


def with_bad_samples(record, rng, size):
    """One in a hundred of the joints' and the gyro's samples off by some sizes of noise."""
    joints, rates = record.joints, record.rates
    position, velocity, rate = (x.copy() for x in (record.q, record.qd, record.omega))
    for values, std in ((position, 1e-5), (velocity, 1e-4), (rate, 1e-5)):
        bad = np.flatnonzero(rng.random(len(values)) < 0.01)
        values[bad, rng.integers(0, values.shape[1], len(bad))] += std * size(len(bad))
    return replace(
        record,
        joints=replace(joints, position=position, velocity=velocity),
        rates=replace(rates, omega=rate),
    )


def test_bad_samples_are_left_out_where_the_model_does_not_explain_them(run, record, rng):
    bad = with_bad_samples(record, rng, lambda n: 10.0 ** rng.uniform(1.5, 6.0, n))
    good, found = (identify(r, servicer(), SETTINGS).estimate for r in (record, bad))
    assert found.valid
    assert 'left out, as they contradict their neighbours' in ''.join(found.notes)
    assert good.notes == record.notes or 'left out' not in ''.join(good.notes)
    spread, before = (np.sqrt(np.diag(e.covariance)) for e in (found, good))
    assert np.all(spread < 1.2 * before)
    error, _ = errors_of(found, truth_of(run))
    assert np.all(np.abs(error[3:6]) < 4.0 * spread[:3])

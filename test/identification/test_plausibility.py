"""Data that are not what they should be are named, and never give a confident wrong number."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import changed, measure, servicer, simulate

from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.faults.motion_faults import contradictions

DEGREE = np.pi / 180.0
INVERSE = [-1.0, -1.0, -1.0, 1.0]


@lru_cache(maxsize=1)
def good():
    return measure(simulate('zyx', 20.0), 1)


def inertial_gyro(data):
    turned = Rotation.from_quat(simulate('zyx', 20.0).attitude_xyzw).apply(np.array(data.omega))
    return changed(data, omega=turned)


FAULTS = {
    'scalar first': (
        lambda d: changed(d, attitude_xyzw=d.attitude_xyzw[:, [3, 0, 1, 2]]),
        'scalar first',
    ),
    'inverse': (
        lambda d: changed(d, attitude_xyzw=d.attitude_xyzw * INVERSE),
        'attitude: it takes inertial to base coordinates',
    ),
    'gyro in deg/s': (
        lambda d: changed(d, omega=d.omega / DEGREE),
        'gyro: rates against the attitude are degrees instead of radians',
    ),
    'gyro in the inertial frame': (inertial_gyro, 'inertial coordinates'),
    'joint rates in deg/s': (
        lambda d: changed(d, qd=d.qd / DEGREE),
        'degrees instead of radians',
    ),
    'swapped joint rates': (
        lambda d: changed(d, qd=d.qd[:, [0, 2, 1]]),
        'columns of j_link_2 and j_link_3 are exchanged',
    ),
    'scalar first and inverse': (
        lambda d: changed(d, attitude_xyzw=(d.attitude_xyzw * INVERSE)[:, [3, 0, 1, 2]]),
        'scalar first, expected xyzw; and it takes inertial to base',
    ),
    'gyro axes': (lambda d: changed(d, omega=d.omega[:, ::-1]), 'its (z, y, x) are the base'),
    'foreign gyro': (
        lambda d: changed(d, omega=np.roll(d.omega, 700, axis=0)),
        'gyro and attitude: they do not belong together',
    ),
    'foreign rates': (
        lambda d: changed(d, qd=np.roll(d.qd, 700, axis=0)),
        'joint positions and rates: they do not belong together',
    ),
}


@pytest.mark.parametrize(('change', 'named'), FAULTS.values(), ids=FAULTS.keys())
def test_faults_are_named(change, named):
    (fault,) = contradictions(change(good()))
    assert named in fault


def test_good_and_resting_data_have_none():
    assert contradictions(good()) == ()
    assert contradictions(measure(simulate('zyx', 20.0, 'still'), 1)) == ()


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize(('order', 'pair'), [([2, 1, 0], (1, 3)), ([0, 2, 1], (2, 3))])
def test_swapped_columns_are_found_by_momentum(structure, order, pair):
    data = good()
    swapped = changed(data, q=data.q[:, order], qd=data.qd[:, order])
    estimate = identify(swapped, servicer('zyx'), IdentifierSettings(structure=structure)).estimate
    assert not estimate.valid
    assert 'j_link_{} and j_link_{} seem to be swapped'.format(*pair) in estimate.reason


def test_a_fault_is_the_verdict():
    data = good()
    estimate = identify(
        changed(data, omega=data.omega / DEGREE),
        servicer('zyx'),
        IdentifierSettings(structure='symmetric'),
    ).estimate
    assert not estimate.valid
    assert 'degrees instead of radians' in estimate.reason


def test_momentum_that_is_not_told_is_no_robot_of_the_file():
    # 47 N m s of the servicer's own wheels that the file believes at rest
    robot = servicer('zyx')
    robot = replace(robot, servicer_wheels=replace(robot.servicer_wheels, momentum=np.zeros(3)))
    estimate = identify(good(), robot, IdentifierSettings(structure='symmetric')).estimate
    assert not estimate.valid
    assert any("scale of all numbers is the file's" in note for note in estimate.notes)

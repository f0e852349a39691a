"""A spinning body with a gyro and a magnetometer, and no attitude."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.estimation.spin import nutation, spin_windows
from spacerobot_ros.inference.decisive import MISFIT
from spacerobot_ros.recording.read import read_records
from spacerobot_ros.recording.record import RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.recording.series import InputSeries
from test.support.lone_body import box_file

AXIS = np.array([0.1, 1.0, 0.0]) / np.linalg.norm([0.1, 1.0, 0.0])
BIAS = np.array([-0.06, 0.01, -0.013])
KAPPA = 0.31
EXAMPLES = Path(__file__).parents[2] / 'config' / 'examples'
DATA = Path(os.environ.get('SPACEROBOT_DATA', EXAMPLES.parents[2] / 'shared' / 'data'))


def spun(rng, rate, *, bias=BIAS, scale=0.02, nutates=0.01, duration=300.0):
    """A steady spin about a body axis, in closed form, with a nutation across it; 1 Hz."""
    time = np.arange(0.0, duration)
    turned = Rotation.from_rotvec(np.outer(rate * time, AXIS))
    field = turned.inv().apply([2e-5, -1e-5, 3e-5])
    field = field + np.array([1e-4, -5e-5, 0.0])
    field += 1e-7 * rng.standard_normal(field.shape)
    gyro = np.tile(rate * AXIS, (len(time), 1)) * [1.0, 1.0 + scale, 1.0] + bias
    phase = KAPPA * rate * time + 0.3
    gyro[:, 0] += nutates * np.cos(phase)
    gyro[:, 2] += 0.4 * nutates * np.sin(phase)
    gyro += 1.5e-3 * rng.standard_normal(gyro.shape)
    stamps = np.round(time * 1e9).astype(int)
    series = InputSeries(('x', 'y', 'z'), stamps, field, ('T',) * 3)
    return Record(rates=RateSeries(stamps, gyro), inputs={'magnetic_field': series}, source='made')


@pytest.fixture(scope='module')
def box(tmp_path_factory):
    return box_file(tmp_path_factory.mktemp('box')).robot


def test_the_magnetometer_tells_rate_axis_and_sense(rng):
    for rate in (0.6, -0.45):
        windows = spin_windows([spun(rng, rate)])
        assert len(windows) == 2
        for window in windows:
            # 150 samples of 3e-3 of the field across the axis: 2e-6 rad/s, and 2e-4 rad
            np.testing.assert_allclose(window.spin, rate * AXIS, atol=1e-3)


def test_nutation_is_found_as_a_share_of_the_spin(rng):
    line = nutation(spin_windows([spun(rng, 0.6), spun(rng, -0.45)]))

    assert abs(line.share - KAPPA) < max(4.0 * line.std, 1e-3)
    assert line.p_value < 1e-50


def test_bias_scale_and_tilt_are_told_apart_by_spins_of_both_senses(box, rng):
    records = [in_robot_order(spun(rng, rate), box) for rate in (0.6, -0.45, 0.3)]

    found = diagnose(records, box)

    causes = {cause.applied.id: cause for cause in found.causes}
    assert found.verdict == 'explained', found.sentence
    assert found.method == 'spin'
    assert found.fit_p > MISFIT > found.null_p
    for axis, true in zip('xyz', BIAS, strict=True):
        value = causes['gyro_bias'].parameters[axis]
        assert abs(value.value - true) < max(4.0 * value.std, 3e-4)
    assert abs(causes['gyro_scale'].parameters['y'].value - 0.02) < 2e-3
    assert 'gyro_misalignment' not in causes
    # the body's own axis is tilted, or both sensors are: nobody can tell
    body = causes['inertial_parameters']
    assert {rival.effect for rival in body.rivals} == {'gyro_misalignment'}
    assert 'Likely' in found.sentence
    # atan 0.1 = 5.71 deg by the one, 2 % less by the other, whose y reads more
    assert re.search(r'lies 5\.[67] .* deg off y towards x, or', found.sentence)
    # kappa^2 Ix Iz = (Iy - Ix) (Iy - Iz), with Iz / Ix as the file has it
    moment = 0.34 + body.parameters['iyy'].value
    square = (moment - 0.30) * (moment - 0.40) / (0.30 * 0.40)
    np.testing.assert_allclose(square, KAPPA**2, rtol=0.05)


def test_one_sense_of_spin_tells_no_bias_from_a_tilt(box, rng):
    found = diagnose([in_robot_order(spun(rng, 0.6, nutates=0.0), box)] * 2, box)

    for cause in found.causes:
        if cause.applied.id != 'inertial_parameters':
            assert cause.rivals, cause.applied.id


def test_a_body_that_does_not_spin_is_refused(box, rng):
    record = in_robot_order(spun(rng, 1e-3, bias=np.zeros(3)), box)

    with pytest.raises(RecordingError, match='0 windows in which the magnetometer sees the body'):
        diagnose([record], box)


@pytest.mark.skipif(
    not (DATA / 'suchai3_cubesat').is_dir(),
    reason=f'no measured data in {DATA}/suchai3_cubesat (set SPACEROBOT_DATA)',
)
def test_suchai3_in_orbit():
    robot = load_robot_file(EXAMPLES / 'suchai3_cubesat.yaml').robot
    names = ('2023-08-24.csv', '2023-11-13.csv', '2024-03.csv')
    paths = [DATA / 'suchai3_cubesat' / name for name in names]

    found = diagnose(read_records(paths, robot, EXAMPLES / 'suchai3_cubesat_map.yaml'), robot)

    causes = {cause.applied.id: cause for cause in found.causes}
    bias = {n: math.degrees(e.value) for n, e in causes['gyro_bias'].parameters.items()}
    assert abs(bias['x'] - -3.66) < 0.05  # deg/s; by a regression against the magnetometer
    assert abs(bias['z'] - -0.78) < 0.05
    body = causes['inertial_parameters']
    assert 1.5e-5 < body.parameters['ixy'].value < 2.5e-5
    assert [rival.effect for rival in body.rivals] == ['gyro_misalignment']
    assert any('nutation at 0.13' in note for note in found.notes)

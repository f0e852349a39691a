"""The robot's own wheels with measured rates: a momentum that changes, and is known."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.flight.monitor import Monitor
from spacerobot_ros.effects.bodies.bodies import NAMES
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import MessageRejectedError, RecordingError
from spacerobot_ros.estimation.possible import is_physical
from spacerobot_ros.model.settings import MonitorSettings
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order

BODY, AXIAL = np.diag([0.30, 0.34, 0.40]), 2e-3
AXIS = np.array([0.0, 0.6, 0.8])
URDF = """<robot name="sat">
<link name="base_link"><inertial><mass value="20"/>
<inertia ixx="0.30" iyy="0.34" izz="0.40" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="disc"><inertial><mass value="0.4"/>
<inertia ixx="1e-3" iyy="1e-3" izz="2e-3" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="wheel" type="continuous"><parent link="base_link"/><child link="disc"/>
<origin rpy="{roll} 0 0"/><axis xyz="0 0 1"/></joint></robot>"""


@pytest.fixture(scope='module')
def satellite(tmp_path_factory):
    folder = tmp_path_factory.mktemp('sat')
    roll = -np.arctan2(AXIS[1], AXIS[2])  # takes z to the wheel's axis
    (folder / 'sat.urdf').write_text(URDF.format(roll=roll))
    robot = {'urdf': 'sat.urdf', 'joints': []}
    robot['servicer_wheels'] = {'joints': ['wheel'], 'rates': [50.0]}
    sensors = {'gyro_std': 1e-4, 'attitude_std': 1e-4}
    content = {'/**': {'ros__parameters': {'robot': robot, 'sensors': sensors}}}
    (folder / 'sat.yaml').write_text(yaml.safe_dump(content))
    return load_robot_file(folder / 'sat.yaml').robot


def flown(rng, robot, duration=12.0, torque=0.0, noise=0.0):
    """A gyrostat whose wheel is driven, by SciPy: J w' + w x (J w + h) = torque - h'."""
    total = robot.bodies[0].inertia  # of body and locked wheel, about their centre of mass

    def speed(t):
        return 50.0 + 60.0 * np.sin(0.7 * t), 42.0 * np.cos(0.7 * t)

    def rate(t, x):
        q, w = x[:4], x[4:]
        omega, slope = speed(t)
        h, dh = AXIAL * omega * AXIS, AXIAL * slope * AXIS
        turn = 0.5 * np.append(q[3] * w + np.cross(q[:3], w), -q[:3] @ w)
        push = np.array([torque, 0.0, 0.0])
        return np.append(turn, np.linalg.solve(total, push - dh - np.cross(w, total @ w + h)))

    start = [0, 0, 0, 1, 0.05, -0.1, 0.08]
    run = solve_ivp(rate, (0.0, duration), start, rtol=1e-10, atol=1e-12, dense_output=True).sol
    gyro, tracker = np.arange(0.0, duration, 0.02), np.arange(0.0, duration, 0.1)
    attitude = Rotation.from_quat(run(tracker)[:4].T)
    attitude = attitude * Rotation.from_rotvec(1e-4 * rng.standard_normal((len(tracker), 3)))
    stamps = np.round(gyro * 1e9).astype(int)
    rates = speed(gyro)[0][:, None]
    rates += noise * rng.standard_normal(rates.shape)
    return in_robot_order(
        Record(
            rates=RateSeries(stamps, run(gyro)[4:].T + 1e-4 * rng.standard_normal((len(gyro), 3))),
            attitudes=AttitudeSeries(np.round(tracker * 1e9).astype(int), attitude.as_quat()),
            wheels=JointSeries(('wheel',), stamps, np.zeros_like(rates), rates),
        ),
        robot,
    )


KINDS = [CATALOGUE[name] for name in ('external_torque_body', 'gyro_bias', 'gyro_drift')]


@pytest.mark.parametrize('noise', [0.0, 0.5])
def test_a_driven_wheel_whose_rate_is_measured_is_no_cause(satellite, rng, noise):
    """Noise of 0.5 rad/s is 30 times the gyro's on the body: at 0.1 eleven hits were named."""
    found = diagnose(flown(rng, satellite, noise=noise), satellite, catalogue=KINDS)

    assert found.verdict == 'consistent'
    assert not found.events.named


def test_the_same_without_the_rate_is_not_explained(satellite, rng):
    record = flown(rng, satellite)
    blind = Record(joints=record.joints, rates=record.rates, attitudes=record.attitudes)

    found = diagnose(blind, satellite, catalogue=KINDS)

    assert found.verdict in ('unexplained', 'partly_explained')


@pytest.mark.parametrize('noise', [0.0, 0.5])
def test_a_torque_beside_it_is_found(satellite, rng, noise):
    record = flown(rng, satellite, torque=2e-3, noise=noise)
    found = diagnose(record, satellite, catalogue=KINDS)

    (cause,) = found.causes
    assert found.verdict == 'explained'
    assert abs(cause.parameters['x'].value - 2e-3) < 4.0 * cause.parameters['x'].std < 1e-4


def test_rates_that_lack_a_wheel_of_the_robot_are_refused(satellite, tmp_path):
    """A misspelt name: its momentum would pass for a constant one without a word."""
    (tmp_path / 'run.csv').write_text(
        't,x,y,z,w\n' + ''.join(f'{k},0,0,0,{k}\n' for k in range(9))
    )
    (tmp_path / 'map.yaml').write_text(
        'time: {columns: t, unit: s}\ngyro: {columns: [x, y, z], unit: rad/s}\n'
        'wheels: {names: [whee], velocity: {columns: w, unit: rpm}}\n'
    )
    with pytest.raises(RecordingError, match=r'wheels.names: must have .* \(wheel\), got whee$'):
        read_record(tmp_path / 'run.csv', satellite, tmp_path / 'map.yaml')


@pytest.mark.parametrize(
    ('is_told', 'noise', 'level'), [(True, 0.0, 'ok'), (True, 0.5, 'ok'), (False, 0.0, 'error')]
)
def test_the_monitor_knows_the_rates(satellite, rng, is_told, noise, level):
    record = flown(rng, satellite, noise=noise)
    monitor = Monitor(satellite, MonitorSettings(), ())
    wheels = dict(zip(record.wheels.stamp_ns.tolist(), record.wheels.velocity, strict=True))
    turned = dict(zip(record.attitudes.stamp_ns.tolist(), record.attitude_xyzw, strict=True))
    for ns, omega in zip(record.rates.stamp_ns.tolist(), record.omega, strict=True):
        if is_told:
            monitor.add_wheels(ns, wheels[ns])
        monitor.add_rate(ns, omega)
        if ns in turned:
            monitor.add_attitude(ns, turned[ns])
        monitor.step()
    assert monitor.state.level == level, monitor.state.reason


def test_rates_of_no_wheel_are_refused(satellite):
    monitor = Monitor(satellite, MonitorSettings(), ())
    for rates in ([1.0, 2.0], [np.nan]):
        with pytest.raises(MessageRejectedError):
            monitor.add_wheels(0, np.array(rates))


def test_a_body_with_nearly_no_inertia_left_is_none(satellite):
    """What a search asks of wheels that nobody measured: a moment below zero by rounding."""
    left = np.array([0, 0, 0, 0, -3e-11, 0, 2e-4, 0, 0, 2e-4])  # beside the mass
    change = np.where(np.arange(10) < 4, 0.0, left - satellite.inertial_parameters[0])
    values = dict(zip(NAMES, change.tolist(), strict=True))
    shrunk = bind_effect('x', 'inertial_parameters', 'base_link', values, satellite)
    assert not is_physical([shrunk], satellite)

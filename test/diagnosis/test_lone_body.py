"""A robot without joints: read, simulated, diagnosed, identified, watched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.events.impulses import steps_beside_usual
from spacerobot_ros.diagnosis.flight.monitor import Monitor
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.errors import ConfigurationError, RecordingError
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.identification.lone_body import identify_lone_body
from spacerobot_ros.recording.faults.data_faults import check_data
from spacerobot_ros.recording.record import AttitudeSeries, RateSeries, Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from test.support.lone_body import box_file

NOISE = 1e-4
BOX = np.diag([0.30, 0.34, 0.40])


STILL = (0.0, 0.0, 0.0)
SENSORS_AND_TORQUES = [
    kind
    for kind in CATALOGUE.values()
    if kind.group == 'sensor' or kind.id.startswith('external_torque')
]


def tumbled(rng, inertia, *, bias=STILL, late=0.0, torque=STILL, drag=0.0, hits=(), duration=12.0):
    """A record of Euler's equations, integrated by SciPy: no code shared with the simulator."""

    def rate(t, x):
        q, w = Rotation.from_quat(x[:4]), x[4:]
        turn = 0.5 * (q.as_quat()[3] * w + np.cross(q.as_quat()[:3], w))
        spin = -0.5 * q.as_quat()[:3] @ w
        momentum = inertia @ w
        push = np.array(torque) - drag * w - np.cross(w, momentum)
        for start, impulse in hits:
            if start < t < start + 0.4:  # sin^2 of 0.4 s has an area of 0.2 s
                push += q.inv().apply(impulse) * np.sin(np.pi * (t - start) / 0.4) ** 2 / 0.2
        return np.concatenate([turn, [spin], np.linalg.solve(inertia, push)])

    motion = solve_ivp(
        rate, (0.0, duration), [0, 0, 0, 1, 0.4, 0.8, 0.2], rtol=1e-11, atol=1e-12,
        dense_output=True, max_step=0.05 if hits else np.inf,
    ).sol  # fmt: skip
    gyro = np.arange(0.5, duration, 0.02)
    tracker = np.arange(0.5, duration, 0.1)
    omega = motion(gyro)[4:].T + bias + NOISE * rng.standard_normal((len(gyro), 3))
    attitude = Rotation.from_quat(motion(tracker - late)[:4].T)
    attitude = attitude * Rotation.from_rotvec(NOISE * rng.standard_normal((len(tracker), 3)))
    return Record(
        rates=RateSeries(np.round(gyro * 1e9).astype(int), omega),
        attitudes=AttitudeSeries(np.round(tracker * 1e9).astype(int), attitude.as_quat()),
    )


@pytest.fixture(scope='module')
def box(tmp_path_factory):
    return box_file(tmp_path_factory.mktemp('box'))


def test_a_right_model_of_a_tumbling_body_is_consistent(box, rng):
    record = in_robot_order(tumbled(rng, BOX), box.robot)

    found = diagnose(record, box.robot)

    assert found.verdict == 'consistent', found.sentence
    assert len(record.q) == len(record.omega)
    assert record.q.shape[1] == 0


def test_a_hit_is_an_event_and_no_cause(box, rng):
    impulse = np.array([0.004, -0.002, 0.003])
    record = in_robot_order(tumbled(rng, BOX, hits=[(6.0, impulse)]), box.robot)

    found = diagnose(record, box.robot, catalogue=SENSORS_AND_TORQUES)

    (event,) = found.events.named
    assert found.verdict == 'explained', found.sentence
    assert found.causes == ()
    assert abs(0.5 * (event.start + event.end) - (6.2 - 0.5)) < 0.1  # since the first sample
    value = np.array([event.peak[axis] for axis in 'xyz'])
    std = np.array([event.peak_std[axis] for axis in 'xyz'])
    assert np.all(np.abs(value - impulse) < 4.0 * std + 0.03 * np.linalg.norm(impulse))


def test_a_weak_torque_that_lasts_is_no_hit(box):
    """One step of the momentum in the middle explains most of it, but less."""
    weak = tumbled(np.random.default_rng(3), BOX, torque=(0.0, 2e-6, 0.0), duration=20.0)
    record = in_robot_order(weak, box.robot)
    seen = observed(record, box.robot)
    noise, _ = noise_levels(box.robot.sensors, seen)
    assert steps_beside_usual(Run(seen, box.robot, (), noise, 'held_before'))[0].named

    found = diagnose(record, box.robot, catalogue=SENSORS_AND_TORQUES)

    assert not found.events.named
    (cause,) = (*found.causes, *found.minor)
    assert cause.applied.id.startswith('external_torque')


def test_hits_whose_traces_lie_over_each_other_are_told_apart(box, rng):
    """Without a torque that nobody knows, a step of the momentum is seen until the end."""
    impulse = 6e-5 * np.array([1.0, -0.5, 0.5])
    hits = [(start, impulse) for start in (6.0, 9.0, 12.0)]
    record = in_robot_order(tumbled(rng, BOX, hits=hits, duration=20.0), box.robot)
    record = observed(record, box.robot)
    noise, _ = noise_levels(box.robot.sensors, record)

    named = steps_beside_usual(Run(record, box.robot, (), noise, 'held_before'))[0].named

    assert [round(0.5 * (e.start + e.end) + 0.3) for e in named] == [6, 9, 12]


BIAS = (2e-3, 0.0, -1e-3)
TILTED = np.array([[0.30, 0.01, 0.0], [0.01, 0.36, 0.0], [0.0, 0.0, 0.40]])


@pytest.mark.parametrize(
    ('cause', 'inertia', 'wrong'),
    [('gyro_bias', BOX, {'bias': BIAS}), ('inertial_parameters', TILTED, {})],
)
def test_a_hit_hides_no_cause(box, rng, cause, inertia, wrong):
    """Neither was named: all that a search chose was unsound, as the hit is in one fifth."""
    impulse = np.array([0.02, -0.012, 0.018])
    hits = [(6.0, impulse)]
    record = in_robot_order(tumbled(rng, inertia, hits=hits, duration=20.0, **wrong), box.robot)
    kinds = [CATALOGUE[name] for name in ('gyro_bias', 'gyro_scale', 'inertial_parameters')]

    found = diagnose(record, box.robot, catalogue=kinds)

    assert found.verdict == 'explained', found.sentence
    assert [c.applied.id for c in found.causes] == [cause]
    (event,) = found.events.named
    np.testing.assert_allclose([event.peak[axis] for axis in 'xyz'], impulse, atol=1e-3)


def test_bias_and_delay_are_named_with_their_size(box, rng):
    record = in_robot_order(tumbled(rng, BOX, bias=(2e-3, 0.0, -1e-3), late=0.04), box.robot)

    found = diagnose(record, box.robot, catalogue=SENSORS_AND_TORQUES)

    assert found.verdict == 'explained', found.sentence
    causes = {c.applied.id: c.parameters for c in found.causes}
    assert set(causes) == {'gyro_bias', 'attitude_delay'}
    for axis, true in zip('xyz', (2e-3, 0.0, -1e-3), strict=True):
        value = causes['gyro_bias'][axis]
        assert abs(value.value - true) < 4.0 * value.std
        assert value.std < 1e-5
    late = causes['attitude_delay']['delay']
    assert abs(late.value - 0.04) < 4.0 * late.std


def test_a_torque_from_outside_is_named(box, rng):
    found = diagnose(
        in_robot_order(tumbled(rng, BOX, torque=(0.0, 3e-4, 0.0)), box.robot), box.robot
    )

    (cause,) = found.causes
    assert cause.applied.id in ('external_torque_body', 'thruster_leak')
    rivals = {cause.applied.id, *(rival.effect for rival in cause.rivals)}
    assert 'external_torque_body' in rivals
    assert found.verdict == 'explained'


def test_drag_is_named_with_its_size(box, rng):
    found = diagnose(in_robot_order(tumbled(rng, BOX, drag=5e-3), box.robot), box.robot)

    (cause,) = found.causes
    assert cause.applied.id == 'rotational_drag'
    drag = cause.parameters['coefficient']
    assert abs(drag.value - 5e-3) < 4.0 * drag.std < 1e-3
    assert found.verdict == 'explained'


TURNED = Rotation.from_rotvec([0.0, 0.0, 0.05])
OTHER = TURNED.as_matrix() @ np.diag([0.30, 0.35, 0.41]) @ TURNED.as_matrix().T


def test_ratios_and_tilt_of_the_inertia_are_found_and_the_scale_is_not(box, rng):
    # any scale moves alike; in half the time wheels that turn freely do as well, in some seeds
    record = in_robot_order(tumbled(rng, 7.0 * OTHER, duration=25.0), box.robot)

    (cause,) = diagnose(record, box.robot).causes

    assert cause.applied.id == 'inertial_parameters'
    assert set(cause.parameters) == {'ixy', 'iyy', 'ixz', 'iyz', 'izz'}
    scale = BOX[0, 0] / OTHER[0, 0]
    for name, (i, j) in {'ixy': (0, 1), 'iyy': (1, 1), 'izz': (2, 2)}.items():
        value = cause.parameters[name]
        assert abs(value.value - (scale * OTHER[i, j] - BOX[i, j])) < 4.0 * value.std
        assert value.std < 1e-3


def test_identify_tells_ratios_with_their_deviation(box, rng):
    record = in_robot_order(tumbled(rng, OTHER), box.robot)

    estimate = identify_lone_body(record, box.robot, ()).estimate

    assert estimate.valid, estimate.reason
    assert estimate.units == ('',) * len(estimate.parameters)
    true = np.array([OTHER[i, j] for i, j in ((1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
    error = (estimate.parameters - true / OTHER[0, 0]) / estimate.std
    assert np.max(np.abs(error)) < 4.0
    assert np.max(estimate.std) < 5e-3


def test_the_monitor_watches_it(box, tmp_path):
    faulty = box_file(tmp_path, effects={'b': {'effect': 'gyro_bias', 'x': 2e-3}})
    levels = {}
    for name, machine in (('right', box), ('biased', faulty)):
        monitor = Monitor(box.robot, box.settings.monitor, ())
        for step in ClosedLoop(machine.robot, machine.settings).run(600):
            step.feed(monitor)
            monitor.step()
        levels[name] = monitor.state.level
    assert levels == {'right': 'ok', 'biased': 'error'}


def test_refusals(box, tmp_path):
    with pytest.raises(ConfigurationError, match=r'robot.joints: is empty: on a fixed base'):
        box_file(tmp_path, robot={'base': 'fixed'})
    with pytest.raises(RecordingError, match='are both missing: nothing of this robot'):
        check_data(in_robot_order(Record(source='x'), box.robot), box.robot)


def test_joint_states_of_no_joint_are_none(box, rng):
    """As a live buffer has them, with rates and efforts of width zero."""
    record = in_robot_order(tumbled(rng, BOX), box.robot)
    empty = np.zeros((len(record.joint_time), 0))
    live = replace(record, joints=replace(record.joints, velocity=empty, effort=empty))
    check_data(in_robot_order(live, box.robot), box.robot)

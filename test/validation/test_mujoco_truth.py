"""The truth generator: clean runs obey the product's equations, effects their closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

mujoco = pytest.importorskip('mujoco')

from support.against_mujoco import point_mass  # noqa: E402

from spacerobot_ros.dynamics.equations import Dynamics  # noqa: E402
from spacerobot_ros.dynamics.state import State  # noqa: E402
from spacerobot_ros.effects.robot_file import load_robot_file  # noqa: E402
from spacerobot_ros.recording.read import read_record  # noqa: E402
from spacerobot_ros.simulation.plant import Plant  # noqa: E402
from validation.mujoco import truth  # noqa: E402
from validation.mujoco.plan import EFFECTS  # noqa: E402
from validation.mujoco.run import EXCITATIONS, Excitation, Simulation  # noqa: E402
from validation.mujoco.sensors import Sensors  # noqa: E402
from validation.mujoco.truth import generate, planned  # noqa: E402

ROBOTS = ('servicer', 'sixdof', 'ground', 'pendulum')


def run(tmp_path, robot, effects=(), duration=2.5, **options):
    """A short run without noise."""
    options = {'noise': False, 'seed': 5, **options}
    return generate(robot, effects, folder=tmp_path, duration=duration, **options)


def left_over(case):
    """What acts beside the measured torque: base torque (N, 3) and joint torques (N, n).

    Inverse dynamics of the believed robot along the true motion; no external force is assumed,
    which fixes the base's linear acceleration. Ends are left out: splines are worse there.
    """
    h = case.history
    robot = load_robot_file(case.robot).robot
    dynamics, n = Dynamics(robot), robot.n_joints
    qdd, alpha = CubicSpline(h.time, h.qd)(h.time, 1), CubicSpline(h.time, h.omega)(h.time, 1)
    rows = np.arange(40, len(h.time) - 40, 25)
    base, joints = np.zeros((len(rows), 3)), np.zeros((len(rows), n))
    for out, k in enumerate(rows):
        attitude = np.roll(h.attitude[k], -1)
        state = State(np.zeros(3), attitude, h.q[k], np.zeros(3), h.omega[k], h.qd[k])
        acceleration = np.concatenate([np.zeros(3), alpha[k]])
        if robot.is_free:
            force, _ = dynamics.inverse(state, acceleration, qdd[k])
            M = dynamics.mass_matrix(h.q[k])
            acceleration[:3] = -force[:3] / M[0, 0]
        wrench, tau = dynamics.inverse(state, acceleration, qdd[k])
        base[out], joints[out] = wrench[3:], tau - h.torque[k]
    return rows, base, joints


# Splines of 5 ms samples and RK4: relative 1e-8 of torques of 1e2 N m.
EXACT = {'rtol': 1e-5, 'atol': 2e-5}


@pytest.mark.parametrize('robot', ROBOTS)
def test_a_clean_run_obeys_the_products_equations(tmp_path, robot):
    case = run(tmp_path, robot)
    _, base, joints = left_over(case)
    scale = np.max(np.abs(case.history.torque))
    np.testing.assert_allclose(base, 0.0, rtol=0.0, atol=1e-6 * scale)
    np.testing.assert_allclose(joints, 0.0, rtol=0.0, atol=1e-6 * scale)
    moved = np.ptp(case.history.q, axis=0)
    assert np.all(moved > 0.02)


@pytest.mark.parametrize('robot', ROBOTS)
def test_a_held_run_is_the_products_plant(tmp_path, robot):
    case = run(tmp_path, robot, excitation='held', sensors=Sensors(effort_mean=False))
    h, what = case.history, load_robot_file(case.robot).robot
    zero, every = np.zeros(3), round(0.01 / h.time[1])
    for k in range(10, 240, 19):
        now, then = k * every, (k + 1) * every
        attitude = np.roll(h.attitude[now], -1)
        start = State(zero, attitude, h.q[now], zero, h.omega[now], h.qd[now])
        plant = Plant(what, start, 0.01, 2)
        plant.step(case.data.joints.effort[k + 1])  # over the period that ended at the stamp
        # RK4 of 5 ms in both, rates of order one.
        np.testing.assert_allclose(plant.state.q, h.q[then], rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(plant.state.qd, h.qd[then], rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(plant.state.omega_WB_B, h.omega[then], rtol=0.0, atol=1e-9)


JOINT = {
    'joint_viscous_friction': ({'coefficient': 3.0}, lambda h: -3.0 * h.qd[:, 1]),
    'joint_coulomb_friction': ({'torque': 0.5}, lambda h: -0.5 * np.tanh(h.qd[:, 1] / 2e-3)),
    'joint_torque_constant': ({'gain': 1.02}, lambda h: 0.02 * h.torque[:, 1]),
    'joint_torque_ripple': (
        {'amplitude': 0.3, 'harmonic': 23.4, 'phase': 0.5},
        lambda h: 0.3 * np.sin(23.4 * h.q[:, 1] + 0.5),
    ),
    'joint_stiffness': (
        {'stiffness': 2.0, 'rest_angle': 0.1},
        lambda h: -2.0 * (h.q[:, 1] - 0.1),
    ),
    'motor_inertia': (
        {'inertia': 0.4},
        lambda h: -0.4 * CubicSpline(h.time, h.qd[:, 1])(h.time, 1),
    ),
    'joint_stribeck_friction': (
        {'coulomb': 0.3, 'static': 0.6, 'velocity': 0.05},
        lambda h: -(0.3 + 0.3 * np.exp(-((h.qd[:, 1] / 0.05) ** 2))) * np.tanh(h.qd[:, 1] / 2e-3),
    ),
}


@pytest.mark.parametrize('effect', JOINT)
@pytest.mark.parametrize('robot', ['sixdof', 'ground'])
def test_what_acts_in_a_joint(tmp_path, robot, effect):
    parameters, law = JOINT[effect]
    case = run(tmp_path, robot, [(effect, 'joint_2', parameters)])
    rows, base, joints = left_over(case)
    expected = np.zeros_like(joints)
    expected[:, 1] = law(case.history)[rows]
    # Dry friction turns within one step: there the spline's derivative is no acceleration.
    away = np.abs(case.history.qd[rows, 1]) > 0.02
    np.testing.assert_allclose(base, 0.0, **{**EXACT, 'atol': 1e-3})
    np.testing.assert_allclose(joints[away], expected[away], **{**EXACT, 'atol': 1e-3})


BASE = {
    'external_torque_body': (
        None,
        {'x': 0.1, 'y': -0.2, 'z': 0.3},
        lambda h, R: np.tile([0.1, -0.2, 0.3], (len(R), 1)),
    ),
    'external_torque_inertial': (
        None,
        {'x': 0.1, 'y': -0.2, 'z': 0.3},
        lambda h, R: np.einsum('i,kij->kj', [0.1, -0.2, 0.3], R),
    ),
    'servicer_wheel_momentum_error': (
        None,
        {'x': 0.5, 'y': 1.0, 'z': -0.7},
        lambda h, R: -np.cross(h.omega, [0.5, 1.0, -0.7]),
    ),
    'servicer_wheel_drag': (
        None,
        {'time_constant': 300.0},
        lambda h, R: _drag(h, np.array([25.0, 27.0, 28.0]), 300.0),
    ),
    'wheel_imbalance': (
        'base_link',
        {'amplitude': 0.5, 'frequency': 46.0, 'phase': 0.2},
        lambda h, R: _turning(0.5, 46.0 * h.time + 0.2),
    ),
}


def _turning(amplitude, angle):
    """About z."""
    return amplitude * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])


def _drag(h, momentum, time_constant):
    lost = np.exp(-h.time / time_constant)[:, None] - 1.0
    return -np.cross(h.omega, lost * momentum) + (1.0 + lost) * momentum / time_constant


def rotations(h):
    w, x, y, z = h.attitude.T / np.linalg.norm(h.attitude, axis=1)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


@pytest.mark.parametrize('effect', BASE)
def test_what_acts_on_the_base(tmp_path, effect):
    where, parameters, law = BASE[effect]
    case = run(tmp_path, 'servicer', [(effect, where, parameters)])
    rows, base, joints = left_over(case)
    expected = law(case.history, rotations(case.history))
    np.testing.assert_allclose(base, expected[rows], **{**EXACT, 'atol': 1e-4})
    np.testing.assert_allclose(joints, 0.0, **{**EXACT, 'atol': 1e-4})


SENSOR = {
    'encoder_offset': ('joint_2', {'offset': 1e-3}),
    'encoder_scale': ('joint_2', {'gain': 1.01}),
    'joint_rate_scale': ('joint_2', {'gain': 1.01}),
    'torque_sensor_bias': ('joint_2', {'bias': 0.3}),
    'gyro_bias': (None, {'x': 1e-3, 'y': 2e-3, 'z': 3e-3}),
    'gyro_scale': (None, {'x': 1e-3, 'y': 2e-3, 'z': 3e-3}),
    'gyro_misalignment': (None, {'x': 1e-4, 'y': 2e-4, 'z': 3e-4}),
    'attitude_misalignment': (None, {'x': 1e-4, 'y': 2e-4, 'z': 3e-4}),
}


@pytest.mark.parametrize('effect', SENSOR)
def test_what_a_sensor_says(tmp_path, effect):
    where, parameters = SENSOR[effect]
    plain = run(tmp_path / 'plain', 'servicer', duration=1.0).data
    data = run(tmp_path, 'servicer', [(effect, where, parameters)], duration=1.0).data
    got = {
        'position': data.joints.position - plain.joints.position,
        'velocity': data.joints.velocity - plain.joints.velocity,
        'effort': data.joints.effort - plain.joints.effort,
        'gyro': data.rates.omega - plain.rates.omega,
        'attitude': 2.0 * _relative(plain.attitudes.q_xyzw, data.attitudes.q_xyzw),
    }
    second = np.array([0.0, 1.0, 0.0])
    vector = np.array([parameters.get(axis, 0.0) for axis in 'xyz'])
    closed = {
        'encoder_offset': ('position', 1e-3 * second),
        'encoder_scale': ('position', 1e-2 * second * plain.joints.position),
        'joint_rate_scale': ('velocity', 1e-2 * second * plain.joints.velocity),
        'torque_sensor_bias': ('effort', 0.3 * second),
        'gyro_bias': ('gyro', vector),
        'gyro_scale': ('gyro', vector * plain.rates.omega),
        'gyro_misalignment': ('gyro', np.cross(vector, plain.rates.omega)),
        'attitude_misalignment': ('attitude', np.tile(vector, (len(got['attitude']), 1))),
    }
    channel, expected = closed[effect]
    for name, values in got.items():
        wanted = expected if name == channel else np.zeros(values.shape[1])
        # misalignments to first order: what is left out is of order angle^2 = 1e-7
        np.testing.assert_allclose(values, wanted + np.zeros_like(values), rtol=0.0, atol=5e-8)


def _relative(a, b):
    """Vector part of a^-1 b, xyzw, with a positive scalar."""
    av, aw, bv, bw = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vec = aw * bv - bw * av - np.cross(av, bv)
    return vec * np.sign(aw * bw + np.sum(av * bv, axis=1, keepdims=True))


def test_delays_make_samples_older_than_their_stamps(tmp_path):
    delays = {'joint_delay': 0.02, 'effort_delay': 0.03, 'imu_delay': 0.01, 'attitude_delay': 0.1}
    plain = run(tmp_path / 'plain', 'servicer', duration=2.0).data
    late = run(
        tmp_path, 'servicer', [(k, None, {'delay': v}) for k, v in delays.items()], duration=2.0
    ).data
    exact = {'rtol': 0.0, 'atol': 1e-9}  # samples fall on steps: splines pass through them
    np.testing.assert_allclose(late.joints.position[2:], plain.joints.position[:-2], **exact)
    np.testing.assert_allclose(late.joints.velocity[2:], plain.joints.velocity[:-2], **exact)
    np.testing.assert_allclose(late.joints.effort[5:], plain.joints.effort[:-5], **exact)
    np.testing.assert_allclose(late.rates.omega[1:], plain.rates.omega[:-1], **exact)
    np.testing.assert_allclose(late.attitudes.q_xyzw[1:], plain.attitudes.q_xyzw[:-1], **exact)


RIGID = {
    'flexible_appendage': (
        'link_3',
        {'frequency': 300.0, 'damping': 0.3, 'inertia': 20.0, 'x': 0.0, 'y': 1.0, 'z': 0.0},
    ),
    'fuel_slosh': ('base_link', {'mass': 50.0, 'frequency': 300.0, 'damping': 0.3}),
    'joint_flexibility': ('joint_2', {'stiffness': 1e6, 'damping': 500.0, 'rotor_inertia': 2.0}),
}


@pytest.mark.parametrize('effect', RIGID)
def test_what_swings_inside_is_the_model_when_it_is_stiff(tmp_path, effect):
    where, parameters = RIGID[effect]
    rotors = [parameters[name] for name in ('rotor_inertia',) if name in parameters]
    rotor = [('motor_inertia', where, {'inertia': inertia}) for inertia in rotors]
    plain = run(tmp_path / 'plain', 'servicer', rotor, duration=2.0)
    stiff = run(tmp_path, 'servicer', [(effect, where, parameters)], duration=2.0)
    # deflections are of order acceleration / frequency^2 = 0.1 / 1e5
    a, b = plain.history, stiff.history
    np.testing.assert_allclose(b.q[-1], a.q[-1], rtol=0.0, atol=2e-4)
    np.testing.assert_allclose(b.omega[-1], a.omega[-1], rtol=0.0, atol=2e-5)


INSIDE = [
    ('joint_viscous_friction', 'joint_1', {'coefficient': 30.0}),
    ('target_wheel_drag', 'link_3', {'time_constant': 30.0}),
    ('joint_coulomb_friction', 'joint_3', {'torque': 3.0}),
]


def test_a_payload_is_carried(tmp_path):
    """A point mass at the tip of a pendulum adds its weight and its m l^2."""
    mass = 0.4
    payload = ('inertial_parameters', 'link_1', point_mass(mass, (0.0, 0.0, -0.5)))
    case = run(tmp_path, 'pendulum', [payload])
    rows, _, joints = left_over(case)
    h = case.history
    qdd = CubicSpline(h.time, h.qd[:, 0])(h.time, 1)
    weight = -mass * (0.25 * qdd + 9.81 * 0.5 * np.sin(h.q[:, 0]))
    np.testing.assert_allclose(joints[:, 0], weight[rows], **EXACT)
    np.testing.assert_allclose(joints[:, 1], 0.0, **EXACT)


@pytest.mark.parametrize('effect', INSIDE, ids=[e[0] for e in INSIDE])
def test_what_acts_inside_keeps_the_momentum(tmp_path, effect):
    """Cause and clean run share their start; inside effects leave the total where it was."""
    case = run(tmp_path, 'servicer', [effect], duration=6.0)
    sim = Simulation(planned(truth.ROBOTS['servicer'], [effect]), 1e-3)
    h = case.history
    totals = []
    for k in (0, len(h.time) - 1):
        sim.place(h.q[k], np.roll(h.attitude[k], -1), h.omega[k])
        sim.data.qvel[sim.v] = h.qd[k]
        mujoco.mj_forward(sim.model, sim.data)
        mujoco.mj_subtreeVel(sim.model, sim.data)
        total = sim.data.subtree_angmom[1].copy()
        for link, momentum in sim.plant.wheels.items():
            rest = np.exp(-h.time[k] / sim.plant.drag.get(link, np.inf))
            total += sim.rotation(link) @ momentum * rest
        totals.append(total)
    np.testing.assert_allclose(totals[1], totals[0], rtol=1e-7, atol=1e-6)


def test_a_bag_is_what_the_record_says_and_a_seed_repeats(tmp_path):
    options = {'noise': True, 'seed': 8, 'duration': 1.0}
    effects = [('gyro_bias', None, {'x': 1e-3, 'y': 0.0, 'z': 0.0})]
    record = run(tmp_path / 'a', 'sixdof', effects, **options).data
    case = run(tmp_path / 'b', 'sixdof', effects, bag=True, **options)
    again = read_record(case.data, load_robot_file(case.robot).robot)
    for name in ('joints', 'rates', 'attitudes'):
        a, b = getattr(record, name), getattr(again, name)
        np.testing.assert_array_equal(a.stamp_ns, b.stamp_ns)
    np.testing.assert_array_equal(record.joints.effort, again.joints.effort)
    np.testing.assert_array_equal(record.rates.omega, again.rates.omega)
    np.testing.assert_allclose(record.attitudes.q_xyzw, again.attitudes.q_xyzw, rtol=0, atol=1e-15)
    other = run(tmp_path / 'c', 'sixdof', effects, **{**options, 'seed': 9}).data
    assert not np.array_equal(other.joints.position, record.joints.position)


def test_noise_is_as_stated(tmp_path):
    plain = run(tmp_path, 'servicer', duration=10.0).data
    noisy = run(tmp_path, 'servicer', noise=True, duration=10.0).data
    for a, b, std in (
        (noisy.joints.position, plain.joints.position, 2e-5),
        (noisy.joints.effort, plain.joints.effort, 0.05),
        (noisy.rates.omega, plain.rates.omega, 2e-5),
    ):
        assert 0.94 * std < np.std(a - b) < 1.06 * std  # 3003 numbers: 1.3 % a sigma


@pytest.mark.parametrize('excitation', EXCITATIONS)
def test_every_motion_stays_near_its_reference(tmp_path, excitation):
    case = run(tmp_path, 'sixdof', excitation=excitation, duration=5.0, noise=True)
    moved = np.max(np.abs(case.history.q - case.history.q[0]), axis=0)
    motion = EXCITATIONS[excitation]
    assert np.all(moved < 2.5 * motion.amplitude)


LEAK = {'force_x': 0.2, 'force_y': 0.0, 'force_z': 0.1, 'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4}
ALL = {
    'target_wheel_momentum': ('link_3', {'x': 5.0, 'y': -3.0, 'z': 2.0}),
    'thruster_leak': (None, LEAK),
    'gravity_gradient': (None, {'orbital_rate': 1.1e-3, 'x': 0.0, 'y': 0.0, 'z': -1.0}),
    'gravity_error': (None, {'x': 0.1, 'y': 0.0, 'z': 0.0}),
    'target_wheel_drag': ('link_3', {'time_constant': 300.0}),
    'wheel_imbalance': ('base_link', {'amplitude': 1.5, 'frequency': 45.9}),
    'inertial_parameters': ('link_3', point_mass(5.0, (2.0, 0.0, 0.0))),
}


def test_every_effect_runs_and_several_at_once(tmp_path):
    covered = {*JOINT, *BASE, *SENSOR, *RIGID, *ALL, 'imu_delay', 'attitude_delay', 'joint_delay',
               'effort_delay'}  # fmt: skip
    assert covered == set(EFFECTS)
    effects = [(name, *entry) for name, entry in ALL.items()]
    plain = run(tmp_path / 'plain', 'servicer', duration=1.0).history
    together = run(tmp_path, 'servicer', effects, duration=1.0).history
    assert np.max(np.abs(together.omega[-1] - plain.omega[-1])) > 1e-5


def test_a_controller_that_sees_faults_feeds_them_back(tmp_path):
    motion = Excitation(control='held', measured=True)
    fault = [('encoder_offset', 'joint_2', {'offset': 1e-2})]
    seen = run(tmp_path, 'servicer', fault, excitation=motion, duration=6.0).history
    clean = run(tmp_path, 'servicer', excitation=motion, duration=6.0).history
    # the controller holds what the encoder says: the arm stands off by the offset
    assert abs(seen.q[-1, 1] - clean.q[-1, 1] + 1e-2) < 2e-3

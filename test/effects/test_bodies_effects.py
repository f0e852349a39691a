"""Bodies off the file, and parts on springs: against MuJoCo, conservation, and their limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.attitudes import angle_between
from support.effects import Engine, held_torque, motion_of, plant_with, run, without_mass
from support.models import random_tree, robot_of, to_mjcf
from support.states import random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effect, changed_robot
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.effects.own_states import driven_states
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.trajectory.reference import Kinematics
from spacerobot_ros.estimation.unknowns.response import InverseDynamics
from spacerobot_ros.simulation.plant import Plant

BASE, LINK, TIP = 'base_link', 'link_2', 'link_4'
AXIS = np.array([2.0, -1.0, 0.5])  # of any length
PERIODS = 80

SPRUNG = {
    'panel on the base': (
        'flexible_appendage',
        BASE,
        {'inertia': 3.0, 'frequency': 2.5, 'damping': 0.01, 'x': 2.0, 'y': -1.0, 'z': 0.5},
    ),
    'boom on a link': (
        'flexible_appendage',
        LINK,
        {'inertia': 0.2, 'frequency': 4.0, 'damping': 0.0, 'x': 0.0, 'y': 1.0, 'z': 0.0},
    ),
    'panel that sways the base': (
        'flexible_appendage',
        BASE,
        {'inertia': 3.0, 'frequency': 2.5, 'damping': 0.01, 'x': 2.0, 'y': -1.0, 'z': 0.5}
        | {'translation_x': 0.6, 'translation_y': 0.4, 'translation_z': -1.2}
        | {'at_x': 0.5, 'at_y': -1.0, 'at_z': 0.3},
    ),
    'boom that sways a link': (
        'flexible_appendage',
        LINK,
        {'inertia': 0.2, 'frequency': 4.0, 'damping': 0.0, 'x': 0.0, 'y': 1.0, 'z': 0.0}
        | {'translation_x': 0.5, 'translation_z': -0.3},
    ),
    'soft grasp': ('grasp_compliance', TIP, {'share': 0.9, 'frequency': 12.0, 'damping': 0.02}),
    'tank in the base': (
        'fuel_slosh',
        BASE,
        {'mass': 5.0, 'frequency': 3.0, 'damping': 0.02, 'x': 0.1, 'y': -0.05, 'z': 0.1},
    ),
    'tank in a link': ('fuel_slosh', LINK, {'mass': 0.5, 'frequency': 5.0, 'damping': 0.0}),
}
VERY_SOFT = ('grasp_compliance', TIP, {'share': 0.9, 'frequency': 2.0, 'damping': 0.02})
"""Gives way by half a radian, which is not small."""


@pytest.fixture
def parts(rng):
    return random_tree(rng, [0, 1, 2, 1], prismatic=(3,))


@pytest.fixture
def robot(parts):
    return robot_of(parts)


def _part(parts, name):
    return next(i for i, part in enumerate(parts) if part.name == name)


# ------------------------------------------------------------------ other bodies


def test_payload_is_a_body_more(parts, rng):
    """A point mass given as ten parameters moves as a link welded there."""
    mass, at = 4.0, np.array([0.3, -0.2, 0.5])
    host = _part(parts, TIP)
    heavier = list(parts)
    heavier[host] = without_mass(parts[host], -mass, at)
    x, y, z = at
    values = {'mass': mass, 'mx': mass * x, 'my': mass * y, 'mz': mass * z}
    values |= {'ixx': mass * (y * y + z * z), 'iyy': mass * (x * x + z * z)}
    values |= {'izz': mass * (x * x + y * y), 'ixy': -mass * x * y}
    values |= {'ixz': -mass * x * z, 'iyz': -mass * y * z}
    robot, known = robot_of(parts), Dynamics(robot_of(heavier))
    changed = bind_effect('x', 'inertial_parameters', TIP, values, robot).change(robot)
    state, tau = random_state(rng, robot.n_joints), rng.standard_normal(robot.n_joints)
    np.testing.assert_allclose(
        Dynamics(changed).rate(state.to_vector(), tau),
        known.rate(state.to_vector(), tau),
        rtol=1e-10,
        atol=1e-10,
    )


def test_payload_on_ground_bends_the_arm_by_its_weight(parts, rng):
    """Static torques grow by m g times the lever arm of the payload about each axis."""
    robot = robot_of(parts, base='fixed', gravity=[0.0, 0.0, -9.81])
    applied = bind_effect('x', 'inertial_parameters', TIP, {'mass': 2.0}, robot)
    state = random_state(rng, robot.n_joints, rate=0.0)
    needed = [
        Dynamics(r).inverse(state, np.zeros(6), np.zeros(robot.n_joints))[1]
        for r in (applied.change(robot), robot)
    ]
    motion = motion_of(robot, rng)
    motion.q[:] = state.q
    weight = motion.link_rotation(TIP)[0].T @ [0.0, 0.0, -2.0 * 9.81]
    expected = -motion.wrench(TIP, weight, None)[0, 6:]
    np.testing.assert_allclose(needed[0] - needed[1], expected, rtol=0, atol=1e-11)


# ------------------------------------------------------------------ sprung parts


@pytest.mark.parametrize('case', SPRUNG)
def test_momentum_is_kept_with_what_the_part_holds(case, robot, rng):
    plant = plant_with(robot, random_state(rng, robot.n_joints), *SPRUNG[case])
    before = plant.ledger()
    run(plant, PERIODS)
    after = plant.ledger()
    assert np.max(np.abs(plant.hidden)) > 1e-2  # the part moves
    assert after.momentum_drift <= 1e-12  # rounding of some thousand stages
    np.testing.assert_allclose(after.linear, before.linear, rtol=0, atol=1e-11)


def _part_energy(plant, parts, case):
    """Kinetic and spring energy of the part [J], from its momentum by textbook formulas."""
    effect, where, values = SPRUNG[case]
    x, own = plant.state, plant.hidden
    motion = Motion(
        plant.robot,
        np.zeros(1),
        x.q[None],
        x.qd[None],
        x.q[None],
        omega=x.omega_WB_B[None],
        velocity=x.v_WB_B[None],
    )
    momentum = plant.effects[0].momentum(motion, own[None])[0]
    R, r = motion.base_rotation(where)[0], motion.link_position(where)[0]
    p, L = R.T @ momentum[:3], R.T @ (momentum[3:] - np.cross(r, momentum[:3]))
    square = values['frequency'] ** 2
    if effect == 'flexible_appendage':
        inertia, (eta, rate) = values['inertia'], own
        axis = np.array([values[name] for name in 'xyz'])
        v, w = np.split(motion.twist(where)[0], 2)
        by_axis = w @ axis / np.linalg.norm(axis)
        P = inertia * np.array([values.get(f'translation_{name}', 0.0) for name in 'xyz'])
        kinetic = 0.5 * inertia * (by_axis + rate) ** 2 + P @ v * rate + v @ np.cross(w, P) * eta
        at = np.array([values.get(f'at_{name}', 0.0) for name in 'xyz'])
        # a mass at p that moves by P: its inertia about the axis of w grows
        kinetic += eta * (at @ P * (w @ w) - (w @ at) * (w @ P))
        return kinetic + 0.5 * inertia * square * eta**2
    if effect == 'fuel_slosh':
        m = values['mass']
        return 0.5 * p @ p / m + 0.5 * m * square * own[:3] @ own[:3]
    host, share = parts[_part(parts, where)], values['share']
    m, inertia, r = share * host.mass, share * host.inertia, own[3:6]
    Q = Rotation.from_quat([*(0.5 * r), 1.0])
    spin = Q.inv().apply(L - np.cross(host.com + own[:3], p))
    kinetic = 0.5 * p @ p / m + 0.5 * spin @ np.linalg.solve(inertia, spin)
    return kinetic + 0.5 * square * (m * own[:3] @ own[:3] + r @ inertia @ r)


@pytest.mark.parametrize('case', SPRUNG)
def test_undamped_part_keeps_the_energy(case, parts, robot, rng):
    effect, where, values = SPRUNG[case]
    state = random_state(rng, robot.n_joints)
    plant = plant_with(robot, state, effect, where, {**values, 'damping': 0.0})
    before = plant.ledger().kinetic + _part_energy(plant, parts, case)
    run(plant, PERIODS)
    after = plant.ledger()
    total = after.kinetic + _part_energy(plant, parts, case) - after.joint_work
    assert abs(total - before) <= 1e-10 * before  # the step's own error
    assert abs(after.effect_work) > 1e-6 * before  # the springs did work


def _with_disc(parts, where, inertia, frequency, damping, axis, **_):
    """MJCF with a disc on a sprung hinge at the host's centre of mass, taken out of the host."""
    axis = np.asarray(axis) / np.linalg.norm(axis)
    tensor = inertia * (0.4 * np.outer(axis, axis) + 0.6 * np.eye(3))
    k = _part(parts, where)
    host, own = parts[k], list(parts)
    own[k] = replace(host, mass=host.mass - 0.1, inertia=host.inertia - tensor)
    t = ' '.join(repr(float(tensor[i])) for i in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)])
    body = (
        f'<body name="disc" pos="{_text(host.com)}"><joint name="spring" type="hinge" '
        f'axis="{_text(axis)}" stiffness="{inertia * frequency**2!r}" '
        f'damping="{2.0 * damping * inertia * frequency!r}"/>'
        f'<inertial pos="0 0 0" mass="0.1" fullinertia="{t}"/></body>'
    )
    return _inside(to_mjcf(own, 1e-3), where, body)


def test_mode_with_translation_is_a_hinged_panel(parts, rng):
    """A panel on a sprung hinge, in MuJoCo; ours is right to first order in its angle."""
    pytest.importorskip('mujoco')
    m, omega, damping = 3.0, 2.5, 0.01
    hinge, axis, lever = np.array([0.2, -0.1, 0.3]), np.array([0.6, 0.0, 0.8]), [0.0, 0.5, 0.2]
    tensor, k = np.diag([0.2, 0.2, 0.2]), _part(parts, BASE)
    sway = m * np.cross(axis, lever)  # linear momentum per rate of the hinge
    turn = tensor @ axis + np.cross(hinge + lever, sway)  # angular, about the host's origin
    inertia = float(axis @ tensor @ axis + np.cross(axis, lever) @ sway)
    size = np.linalg.norm(turn)
    values = {'inertia': size**2 / inertia, 'frequency': omega, 'damping': damping}
    values |= dict(zip('xyz', turn, strict=True))
    values |= {f'translation_{n}': p / size for n, p in zip('xyz', sway, strict=True)}
    values |= {f'at_{n}': p for n, p in zip('xyz', hinge + lever, strict=True)}
    host = without_mass(parts[k], m, hinge + lever)
    own = list(parts)
    own[k] = replace(host, inertia=host.inertia - tensor)
    body = (
        f'<body name="panel" pos="{_text(hinge)}"><joint name="spring" type="hinge" '
        f'axis="{_text(axis)}" stiffness="{inertia * omega**2!r}" '
        f'damping="{2.0 * damping * inertia * omega!r}"/><inertial pos="{_text(lever)}" '
        f'mass="{m!r}" diaginertia="{_text(np.diag(tensor))}"/></body>'
    )
    robot = robot_of(parts)
    state = random_state(rng, robot.n_joints, rate=0.2)
    plant = plant_with(robot, state, 'flexible_appendage', BASE, values)
    engine = Engine(_inside(to_mjcf(own, 1e-3), BASE, body), robot.joints)
    engine.place(state)
    bent = 0.02  # rad, at first, and its hinge
    plant.hidden[0] = bent * inertia / size
    engine.data.qpos[engine.model.joint('spring').qposadr[0]] = bent
    ours, theirs = [], []
    for _ in range(4 * PERIODS):
        plant.step(np.zeros(robot.n_joints))
        engine.rest(1)
        ours.append([*plant.state.q, plant.hidden[0]])
        bent = engine.angle('spring') * inertia / size
        theirs.append([*map(engine.angle, robot.joints), bent])
    # second order: products of angles and of rates; without the translation it is off by 9e-3
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=4e-4)


def _with_tank(parts, where, mass, frequency, damping, x=0.0, y=0.0, z=0.0):
    """MJCF with a point mass on three sprung slides, taken out of the host."""
    at = np.array([x, y, z])
    own = list(parts)
    own[_part(parts, where)] = without_mass(parts[_part(parts, where)], mass, at)
    slides = ''.join(
        f'<joint name="fuel_{n}" type="slide" axis="{_text(a)}" '
        f'stiffness="{mass * frequency**2!r}" damping="{2.0 * damping * mass * frequency!r}"/>'
        for n, a in zip('xyz', np.eye(3), strict=True)
    )
    body = (
        f'<body name="fuel" pos="{_text(at)}">{slides}'
        f'<inertial pos="0 0 0" mass="{mass!r}" diaginertia="1e-9 1e-9 1e-9"/></body>'
    )
    return _inside(to_mjcf(own, 1e-3), where, body)


@pytest.mark.parametrize('case', ['boom that sways a link', 'soft grasp', 'tank in a link'])
def test_all_frames_that_move_on_evenly_see_the_same(case, robot, rng):
    """Galilei: a boost of 3 m/s, and another orientation of the inertial axes."""
    state, boost = random_state(rng, robot.n_joints), np.array([1.0, -2.0, 2.0])
    turn = Rotation.random(random_state=1)
    R_WB = Rotation.from_quat(state.q_WB_xyzw)
    seen = replace(
        state,
        p_WB=turn.apply(state.p_WB),
        q_WB_xyzw=(turn * R_WB).as_quat(),
        v_WB_B=state.v_WB_B + R_WB.inv().apply(boost),
    )
    here, there = (plant_with(robot, x, *SPRUNG[case]) for x in (state, seen))
    a, b = run(here, PERIODS), run(there, PERIODS)
    # rounding of some thousand stages
    np.testing.assert_allclose(there.hidden, here.hidden, rtol=0, atol=1e-9)
    np.testing.assert_allclose([*b.q, *b.qd], [*a.q, *a.qd], rtol=0, atol=1e-9)
    np.testing.assert_allclose(b.omega_WB_B, a.omega_WB_B, rtol=0, atol=1e-9)
    moved = turn.apply(a.p_WB + boost * PERIODS * 0.01)
    np.testing.assert_allclose(b.p_WB, moved, rtol=0, atol=1e-9)


def _inside(text, where, body):
    """MJCF with a body put in front of whatever its host carries."""
    start = text.index(f'<body name="{where}"')
    end = text.index('/>', text.index('<inertial', start)) + 2
    return text[:end] + body + text[end:]


def _text(values):
    return ' '.join(repr(float(v)) for v in values)


def _with_grasp(parts, where, share, frequency, damping):
    """MJCF with a share of a body on three sprung slides and a sprung ball, taken out of it."""
    own, k = list(parts), _part(parts, where)
    host = parts[k]
    own[k] = replace(host, mass=(1 - share) * host.mass, inertia=(1 - share) * host.inertia)
    m, i = share * host.mass, share * float(host.inertia[0, 0])
    springs = [
        f'stiffness="{x * frequency**2!r}" damping="{2.0 * damping * x * frequency!r}"'
        for x in (m, i)
    ]
    slides = ''.join(
        f'<joint name="part_{n}" type="slide" axis="{_text(a)}" {springs[0]}/>'
        for n, a in zip('xyz', np.eye(3), strict=True)
    )
    body = (
        f'<body name="part" pos="{_text(host.com)}">{slides}'
        f'<joint name="turn" type="ball" {springs[1]}/>'
        f'<inertial pos="0 0 0" mass="{m!r}" diaginertia="{_text(i * np.ones(3))}"/></body>'
    )
    return _inside(to_mjcf(own, 1e-3), where, body)


@pytest.mark.parametrize('case', [c for c in SPRUNG if 'sways' not in c])
def test_run_against_mujoco(case, parts, rng):
    pytest.importorskip('mujoco')
    effect, where, values = SPRUNG[case]
    if effect == 'flexible_appendage':
        axis = [values[name] for name in 'xyz']
        text = _with_disc(parts, where, axis=axis, **values)
        springs = ['spring']
    elif effect == 'grasp_compliance':  # MuJoCo's ball is as stiff about all axes
        tip = _part(parts, where)
        parts[tip] = replace(parts[tip], inertia=parts[tip].inertia[0, 0] * np.eye(3))
        text, springs = _with_grasp(parts, where, **values), ['part_x', 'part_y', 'part_z']
    else:
        text, springs = _with_tank(parts, where, **values), ['fuel_x', 'fuel_y', 'fuel_z']
    robot = robot_of(parts)
    state = random_state(rng, robot.n_joints, rate=0.5)
    plant = plant_with(robot, state, effect, where, values)
    ours = run(plant, PERIODS)
    engine = Engine(text, robot.joints)
    engine.place(state)
    engine.run(PERIODS)
    # RK4 at 1 ms
    assert angle_between(ours.q_WB_xyzw, engine.attitude_xyzw) <= 1e-6
    theirs = [engine.angle(joint) for joint in robot.joints]
    np.testing.assert_allclose(ours.q, theirs, rtol=0, atol=1e-6)
    parts_own = [engine.angle(joint) for joint in springs]
    assert np.max(np.abs(parts_own)) > 1e-3
    np.testing.assert_allclose(plant.hidden[: len(springs)], parts_own, rtol=0, atol=1e-6)


@pytest.mark.parametrize('case', SPRUNG)
def test_stiff_spring_is_the_files_robot(case, robot, rng):
    """Accelerations differ by the part's quasi-static motion, which goes with 1 / omega^2."""
    effect, where, values = SPRUNG[case]
    state = random_state(rng, robot.n_joints, rate=0.3)
    rigid = run(Plant(robot, state, 0.01, 1), 20)
    errors = []
    for frequency in (40.0, 160.0):
        stiff = {**values, 'frequency': frequency, 'damping': 0.7}
        bent = run(plant_with(robot, state, effect, where, stiff), 20)
        errors.append(np.max(np.abs(bent.to_vector() - rigid.to_vector())[7 : 7 + len(state.q)]))
    assert errors[0] <= 2e-2
    assert errors[1] <= errors[0] / 8.0  # 16 to first order


def test_panel_rings_at_its_frequency_and_decays(robot):
    """On a turntable that stops: eta = -w / omega_d exp(-zeta omega t) sin(omega_d t)."""
    values = {'inertia': 1e-9, 'frequency': 4.0, 'damping': 0.05, 'x': 0.0, 'y': 0.0, 'z': 1.0}
    n = robot.n_joints
    state = State(*(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(n)), *_still(n))
    plant = plant_with(robot, state, 'flexible_appendage', BASE, values)
    plant.hidden[:] = [0.0, 0.3]
    for _ in range(100):
        plant.step(np.zeros(n))
    decay, omega = 0.05 * 4.0, 4.0 * np.sqrt(1.0 - 0.05**2)
    expected = 0.3 / omega * np.exp(-decay) * np.sin(omega)
    assert abs(plant.hidden[0] - expected) <= 1e-8  # inertia against the base's: 1e-9


def _still(n):
    return np.zeros(3), np.zeros(3), np.zeros(n)


def test_tank_hangs_by_its_weight(parts, rng):
    """On ground the fuel settles g / omega^2 below its place, and all of the weight is felt."""
    robot = robot_of(parts, base='fixed', gravity=[0.0, 0.0, -9.81])
    values = {'mass': 0.5, 'frequency': 30.0, 'x': 0.1, 'y': 0.2, 'z': 0.0}
    applied = bind_effect('x', 'fuel_slosh', LINK, values, robot)
    motion = motion_of(changed_robot(robot, [applied]), rng)
    motion.qd[:], motion.acceleration = 0.0, np.zeros((1, 6 + robot.n_joints))
    motion.omega, motion.velocity = np.zeros((1, 3)), np.zeros((1, 3))
    g = motion.link_rotation(LINK)[0].T @ [0.0, 0.0, -9.81]
    hidden = np.concatenate([g / 30.0**2, np.zeros(3)])[None]
    np.testing.assert_allclose(applied.hidden_rate(motion, hidden), np.zeros((1, 6)), atol=1e-12)
    place = np.array([0.1, 0.2, 0.0]) + hidden[0, :3]
    expected = motion.wrench(LINK, 0.5 * g, None, place)
    np.testing.assert_allclose(applied.force(motion, hidden), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize('case', ['panel on the base', 'very soft grasp'])
def test_states_along_a_motion_are_those_of_the_plant(case, robot, rng):
    """The diagnosis drives a part by the recorded motion: it finds the states of the plant."""
    effect, where, values = {**SPRUNG, 'very soft grasp': VERY_SOFT}[case]
    plant = plant_with(robot, random_state(rng, robot.n_joints, rate=0.3), effect, where, values)
    states, own = [plant.state.to_vector()], [plant.hidden.copy()]
    for k in range(100):
        plant.step(held_torque(k, robot.n_joints))
        states.append(plant.state.to_vector())
        own.append(plant.hidden.copy())
    x, n = np.array(states), robot.n_joints
    time = 0.01 * np.arange(101)
    motion = motion_of(plant.robot, rng, 101)
    motion.time = time
    motion.q, motion.qd = x[:, 7 : 7 + n], x[:, 13 + n :]
    motion.omega, motion.velocity = x[:, 10 + n : 13 + n], x[:, 7 + n : 10 + n]
    motion.acceleration = np.gradient(x[:, 7 + n :], time, axis=0, edge_order=2)
    found = plant.effects[0].driven(motion)
    # differences over held torques: some 1e-3 of accelerations
    np.testing.assert_allclose(found, own, rtol=0, atol=5e-3 * np.max(np.abs(own)))


@pytest.mark.parametrize(
    'case',
    [
        *('panel on the base', 'panel that sways the base', 'very soft grasp'),
        *('tank in the base', 'tank in a link'),
    ],
)
def test_what_nobody_measures_of_the_base_is_made_up_for(case, robot, rng):
    """Translations are not measured: the whole recoils from its part, one in ten of its mass."""
    effect, where, values = {**SPRUNG, 'very soft grasp': VERY_SOFT}[case]
    plant = plant_with(robot, random_state(rng, robot.n_joints, rate=0.3), effect, where, values)
    states, own = [plant.state.to_vector()], [plant.hidden.copy()]
    for k in range(100):
        plant.step(held_torque(k, robot.n_joints))
        states.append(plant.state.to_vector())
        own.append(plant.hidden.copy())
    x, n = np.array(states), robot.n_joints
    time = 0.01 * np.arange(101)
    rates = np.gradient(x[:, 10 + n :], time, axis=0, edge_order=2)
    motion = InverseDynamics(plant.robot).motion(
        Kinematics(
            time,
            x[:, 7 : 7 + n],
            x[:, 13 + n :],
            x[:, 10 + n : 13 + n],
            Rotation.from_quat(x[:, 3:7]),
            rates[:, 3:],
            rates[:, :3],
        ),
        np.zeros((101, n)),
    )
    found = plant.effects[0].driven(motion)
    # differences over held torques: some 1e-3 of accelerations
    np.testing.assert_allclose(found, own, rtol=0, atol=5e-3 * np.max(np.abs(own)))


def test_an_oscillator_is_driven_by_itself_as_together(robot, rng):
    effect, where, values = SPRUNG['boom on a link']
    applied = bind_effect('x', effect, where, values, robot)
    n = robot.n_joints
    motion = motion_of(robot, rng, 30, acceleration=rng.standard_normal((30, 6 + n)))
    together = driven_states(
        lambda own: applied.hidden_rate(motion, own), motion.time, applied.hidden
    )
    np.testing.assert_allclose(applied.driven(motion), together, rtol=0, atol=1e-12)


def test_driven_oscillator_in_closed_form():
    """x'' = -9 x - 0.12 x' + cos(0.7 t) from rest, sampled at 100 Hz."""
    time = np.linspace(0.0, 20.0, 2001)

    def rate(x):
        return np.stack([x[:, 1], -9.0 * x[:, 0] - 0.12 * x[:, 1] + np.cos(0.7 * time)], axis=1)

    steady = 1.0 / (9.0 - 0.49 + 0.12j * 0.7)
    damped = np.sqrt(9.0 - 0.06**2)
    a = -steady.real
    b = (0.06 * a - (0.7j * steady).real) / damped
    free = np.exp(-0.06 * time) * (a * np.cos(damped * time) + b * np.sin(damped * time))
    expected = (steady * np.exp(0.7j * time)).real + free
    found = driven_states(rate, time, 2)[:, 0]
    # trapezium rule: (0.7 * 0.01)^2 / 12 of 0.12, at resonance some more
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-5)


# ------------------------------------------------------------------ bad input


@pytest.mark.parametrize(
    ('effect', 'where', 'values', 'message'),
    [
        ('inertial_parameters', LINK, {'mass': -500.0}, 'leaves link_2 with a mass of -'),
        ('inertial_parameters', LINK, {'ixx': -500.0}, 'leaves link_2 with a moment of inertia'),
        ('inertial_parameters', 'link_9', {'mass': 1.0}, "no place 'link_9'"),
        ('inertial_parameters', LINK, {'m': 1.0}, 'no such parameter'),
        (
            'flexible_appendage',
            BASE,
            {'inertia': 1.0, 'frequency': 0.0, 'x': 1.0, 'y': 0.0, 'z': 0.0},
            'frequency: 0 rad/s must be above 0',
        ),
        (
            'flexible_appendage',
            BASE,
            {'inertia': 1.0, 'frequency': 2.0, 'x': 0.0, 'y': 0.0, 'z': 0.0},
            'x: the axis x, y, z has no direction',
        ),
        (
            'flexible_appendage',
            BASE,
            {'inertia': 1e4, 'frequency': 2.0, 'x': 1.0, 'y': 0.0, 'z': 0.0},
            'leaves base_link with a moment of inertia',
        ),
        (
            'flexible_appendage',
            BASE,
            {'inertia': 1.0, 'frequency': 2.0, 'x': 1.0, 'y': 0.0, 'z': 0.0, 'translation_z': 8.0},
            'translation_z: base_link has less mass than takes part',
        ),
        ('flexible_appendage', BASE, {'inertia': 1.0, 'frequency': 2.0}, 'x: is missing'),
        ('fuel_slosh', BASE, {'mass': 1.0, 'frequency': 1.0, 'damping': -0.1}, 'at least 0'),
        ('fuel_slosh', BASE, {'mass': 51.0, 'frequency': 1.0}, 'leaves base_link with a mass of'),
        ('grasp_compliance', TIP, {'share': 1.0, 'frequency': 9.0}, 'must be at most 0.99'),
        ('grasp_compliance', BASE, {'share': 0.5, 'frequency': 9.0}, "no place 'base_link'"),
    ],
)
def test_nonsense_is_refused(effect, where, values, message, robot):
    with pytest.raises(ConfigurationError, match=message):
        bind_effect('part', effect, where, values, robot)


def test_a_fixed_base_carries_no_sprung_part(parts):
    robot = robot_of(parts, base='fixed')
    with pytest.raises(ConfigurationError, match="no place 'base_link'"):
        bind_effect('x', 'fuel_slosh', BASE, {'mass': 1.0, 'frequency': 1.0}, robot)


def test_a_grasp_of_nothing_is_none(robot):
    """A search may begin there: its inertia was not a number, and no search went on."""
    effect = bind_effect('x', 'grasp_compliance', TIP, {'share': 0.0, 'frequency': 9.0}, robot)
    assert effect.moved(effect.change(robot)) == pytest.approx(np.zeros((6, 6)), abs=0.0)

"""What the replay hides in a machine, by the ids and parameters of docs/effects.md.

Friction, springs, rotors and payloads are MuJoCo's own joints and bodies; the rest are torques,
asked for at every stage of its Runge-Kutta steps, and what sensors say.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .plant import Body, Motion, Plant

Values = Mapping[str, float]
Hidden = Sequence[tuple[str, str | None, Values]]
_TINY = 1e-9  # kg, kg m^2: of bodies that only carry a joint


def turn(v: np.ndarray) -> np.ndarray:
    """(3, 3) rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(v))
    K = np.cross(np.eye(3), v)
    if angle < 1e-12:
        return np.eye(3) + K
    return np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * K @ K


def xyz(v: Values, prefix: str = '') -> np.ndarray:
    """(3,) of a vector's parameters."""
    return np.array([v[prefix + axis] for axis in 'xyz'])


def _attribute(name: str, parameter: str) -> Callable[[Plant, Any, Values], None]:
    def apply(p: Plant, joint: Any, v: Values) -> None:
        own = p.joint(joint)
        own[name] = own.get(name, 0.0) + v[parameter]

    return apply


def _spring(p: Plant, joint: Any, v: Values) -> None:
    p.joint(joint).update(stiffness=v['stiffness'], springref=v['rest_angle'])


def _ripple(p: Plant, joint: Any, v: Values) -> None:
    i = p.joints.index(joint)

    def push(m: Motion) -> None:
        angle = v['harmonic'] * m.data.qpos[m.q[i]] + v['phase']
        m.data.qfrc_passive[m.v[i]] += v['amplitude'] * math.sin(angle)

    p.pushes.append(push)


def _gain(p: Plant, joint: Any, v: Values) -> None:
    p.gain[p.joints.index(joint)] *= v['gain']


def _body(p: Plant, link: Any, v: Values) -> None:
    body = p.bodies[link]
    body.mass += v['mass']
    body.first = body.first + xyz(v, 'm')
    rows = [['ixx', 'ixy', 'ixz'], ['ixy', 'iyy', 'iyz'], ['ixz', 'iyz', 'izz']]
    body.inertia = body.inertia + np.array([[v[k] for k in row] for row in rows])


def _panel(p: Plant, link: Any, v: Values) -> None:
    """A disc on a spring at the host's centre of mass; with the spring stiff it is the host."""
    host, axis = p.bodies[link], xyz(v) / np.linalg.norm(xyz(v))
    tensor = v['inertia'] * (np.outer(axis, axis) + 0.6 * (np.eye(3) - np.outer(axis, axis)))
    mass, com = 1e-3 * host.mass, host.com
    host.add(mass, com, tensor, -1.0)
    joint = {'name': f'{link}_panel', 'type': 'hinge', 'axis': axis}
    joint |= _mode(v['inertia'], v)
    p.bodies[joint['name']] = Body(link, com, np.zeros(3), mass, np.zeros(3), tensor, joint)


def _slosh(p: Plant, link: Any, v: Values) -> None:
    """A point mass on three springs at the host's centre of mass."""
    host = p.bodies[link]
    parent, at = link, host.com
    host.add(v['mass'], at, np.zeros((3, 3)), -1.0)
    for k, axis in enumerate(np.eye(3)):
        name, mass = f'{link}_fuel_{k}', v['mass'] if k == 2 else _TINY
        joint = {'name': name, 'type': 'slide', 'axis': axis} | _mode(v['mass'], v)
        p.bodies[name] = Body(parent, at, np.zeros(3), mass, np.zeros(3), _TINY * np.eye(3), joint)
        parent, at = name, np.zeros(3)


def _mode(inertia: float, v: Values) -> dict[str, float]:
    w = v['frequency']
    return {'stiffness': inertia * w * w, 'damping': 2.0 * v['damping'] * inertia * w}


def _wheels(p: Plant, link: Any, v: Values) -> None:
    host = link or p.base
    p.wheels[host] = p.wheels.get(host, np.zeros(3)) + xyz(v)


def _drag(p: Plant, link: Any, v: Values) -> None:
    p.drag[link or p.base] = v['time_constant']


def _torque_body(p: Plant, _: Any, v: Values) -> None:
    p.pushes.append(lambda m: m.push(p.base, m.rotation(p.base) @ xyz(v)))


def _torque_inertial(p: Plant, _: Any, v: Values) -> None:
    p.pushes.append(lambda m: m.push(p.base, xyz(v)))


def _leak(p: Plant, _: Any, v: Values) -> None:
    def push(m: Motion) -> None:
        R = m.rotation(p.base)
        at = m.data.xpos[m.body[p.base]] + R @ xyz(v, 'at_')
        m.push(p.base, np.zeros(3), R @ xyz(v, 'force_'), at)

    p.pushes.append(push)


def _gravity(p: Plant, _: Any, v: Values) -> None:
    p.gravity = p.gravity + xyz(v)


def _reading(
    channel: str, change: Callable[[np.ndarray, Values], np.ndarray]
) -> Callable[[Plant, Any, Values], None]:
    """A sensor that says something else; of a joint's sensor its column alone."""

    def apply(p: Plant, where: Any, v: Values) -> None:
        own = slice(None) if where is None else p.joints.index(where)

        def mend(samples: dict[str, np.ndarray]) -> None:
            samples[channel][:, own] = change(samples[channel][:, own], v)

        p.mends.append(mend)

    return apply


def _delay(clock: str) -> Callable[[Plant, Any, Values], None]:
    return lambda p, _, v: p.delays.__setitem__(clock, v['delay'])


EFFECTS: dict[str, Callable[[Plant, Any, Values], None]] = {
    'joint_viscous_friction': _attribute('damping', 'coefficient'),
    'joint_coulomb_friction': _attribute('frictionloss', 'torque'),
    'motor_inertia': _attribute('armature', 'inertia'),
    'joint_stiffness': _spring,
    'joint_torque_ripple': _ripple,
    'joint_torque_constant': _gain,
    'inertial_parameters': _body,
    'flexible_appendage': _panel,
    'fuel_slosh': _slosh,
    'target_wheel_momentum': _wheels,
    'servicer_wheel_momentum_error': _wheels,
    'target_wheel_drag': _drag,
    'servicer_wheel_drag': _drag,
    'external_torque_body': _torque_body,
    'external_torque_inertial': _torque_inertial,
    'thruster_leak': _leak,
    'gravity_error': _gravity,
    'encoder_offset': _reading('q', lambda x, v: x + v['offset']),
    'encoder_scale': _reading('q', lambda x, v: x * v['gain']),
    'joint_rate_scale': _reading('qd', lambda x, v: x * v['gain']),
    'torque_sensor_bias': _reading('tau', lambda x, v: x + v['bias']),
    'gyro_bias': _reading('omega', lambda x, v: x + xyz(v)),
    'gyro_scale': _reading('omega', lambda x, v: x * (1.0 + xyz(v))),
    'gyro_misalignment': _reading('omega', lambda x, v: x @ turn(xyz(v)).T),
    'attitude_misalignment': _reading('attitude', lambda x, v: x @ turn(xyz(v))),
    'joint_delay': _delay('joints'),
    'effort_delay': _delay('effort'),
    'imu_delay': _delay('imu'),
    'attitude_delay': _delay('attitude'),
}

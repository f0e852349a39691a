"""The robot and the motion that every engine simulates, in plain numbers; needs only NumPy.

A free-floating servicer (Table I of the identification paper) with three reaction wheels on its
base and three on the captured body, as true rotors: 2,580 kg of arm and base, ten bodies, no
gravity. Joint axes z, y, y. Wheels are taken out of their carriers' mass and inertia.

Two runs of 20 s: `smooth`, the torques below as functions of time, and `held`, the same torques
held over control periods of 10 ms at their value at the start of each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

DURATION, PERIOD = 20.0, 0.01
SCENARIOS = ('smooth', 'held')
ATTITUDE_XYZW = np.array([0.2, 0.1, 0.3, 0.927]) / np.linalg.norm([0.2, 0.1, 0.3, 0.927])
OMEGA_B = np.array([0.1, 0.12, 0.08])
AMPLITUDE, FREQUENCY = (40.0, 40.0, 20.0), (0.9, 0.7, 1.1)  # N m, rad/s

_WHEEL_MASS, _SPIN, _ACROSS = 10.0, 0.1, 0.06  # kg, kg m^2 about and across the axis
_BASE_MOMENTUM, _TARGET_MOMENTUM = (25.0, 27.0, 28.0), (42.0, 49.0, 41.0)  # N m s


@dataclass(frozen=True)
class Part:
    """A body: joint with its parent, and mass properties about its centre of mass."""

    name: str
    parent: int
    axis: tuple[float, float, float]
    origin: tuple[float, float, float]
    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float]
    rate: float = 0.0


def torque(t: float) -> tuple[float, float, float]:
    """Joint torques of the smooth run [N m]."""
    a, f = AMPLITUDE, FREQUENCY
    return (a[0] * math.sin(f[0] * t), a[1] * math.sin(f[1] * t), a[2] * math.sin(f[2] * t))


def parts() -> list[Part]:
    """Base, three links, then the wheels of the base and of link 3."""
    none = (0.0, 0.0, 0.0)
    wheels = _SPIN + 2.0 * _ACROSS  # about each axis of the carrier, all three wheels together
    rest, link_3 = 1500.0 - wheels, (400.0 - wheels, 300.0 - wheels, 350.0 - wheels)
    body = [
        Part('base', -1, none, none, 1970.0, none, (rest, rest, rest)),
        Part('link1', 0, (0, 0, 1), (0.5, 0.5, 1.0), 50.0, (0.25, 0, 0), (0.1, 11.0, 11.0)),
        Part('link2', 1, (0, 1, 0), (0.5, 0, 0), 100.0, (1.0, 0, 0), (0.1, 33.0, 33.0)),
        Part('link3', 2, (0, 1, 0), (2.0, 0, 0), 470.0, (1.0, 0, 0), link_3),
    ]
    for carrier, momentum in ((0, _BASE_MOMENTUM), (3, _TARGET_MOMENTUM)):
        for k in range(3):
            axis = tuple(float(a == k) for a in range(3))
            inertia = tuple(_SPIN if a == k else _ACROSS for a in range(3))
            name, at = f'wheel{carrier}{k}', body[carrier].com
            body.append(
                Part(name, carrier, axis, at, _WHEEL_MASS, none, inertia, momentum[k] / _SPIN)
            )
    return body


PARTS = parts()
JOINTS = tuple(part.name for part in PARTS[1:])
RATES = np.array([part.rate for part in PARTS[1:]])


def urdf() -> str:
    """The robot as URDF; the joint of a body is called j_<body>."""
    rows = ['<robot name="servicer">']
    for part in PARTS:
        xx, yy, zz = part.inertia
        rows.append(
            f'<link name="{part.name}"><inertial><origin xyz="{_words(part.com)}"/>'
            f'<mass value="{part.mass!r}"/><inertia ixx="{xx!r}" iyy="{yy!r}" izz="{zz!r}" '
            'ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
    rows += [
        f'<joint name="j_{part.name}" type="continuous"><parent link="{PARTS[part.parent].name}"/>'
        f'<child link="{part.name}"/><origin xyz="{_words(part.origin)}"/>'
        f'<axis xyz="{_words(part.axis)}"/></joint>'
        for part in PARTS[1:]
    ]
    return '\n'.join([*rows, '</robot>'])


def mjcf(step: float = 1e-3, integrator: str = 'RK4') -> str:
    """The robot as MuJoCo's XML, a motor at every arm joint."""
    motors = ''.join(f'<motor joint="j_link{k}"/>' for k in (1, 2, 3))
    return (
        f'<mujoco><option timestep="{step!r}" gravity="0 0 0" integrator="{integrator}">'
        '<flag contact="disable" constraint="disable"/></option>'
        f'<worldbody>{_mjcf_body(0)}</worldbody><actuator>{motors}</actuator></mujoco>'
    )


def momentum(rotation, omega_W, velocity_W, q, qd):
    """Angular momentum about the centre of mass [N m s], written from first principles.

    Args:
        rotation: (3, 3) base to inertial coordinates.
        omega_W: (3,) angular velocity of the base, inertial coordinates [rad/s].
        velocity_W: (3,) velocity of the base origin, inertial coordinates [m/s].
        q: Joint positions, in the order of `JOINTS` [rad].
        qd: Joint rates [rad/s].
    """
    turns, places = [np.asarray(rotation)], [np.zeros(3)]
    spins, speeds = [np.asarray(omega_W)], [np.asarray(velocity_W)]
    for part, angle, rate in zip(PARTS[1:], q, qd, strict=True):
        i, axis = part.parent, np.array(part.axis, dtype=float)
        arm = turns[i] @ np.array(part.origin, dtype=float)
        turns.append(turns[i] @ _turn(axis, float(angle)))
        places.append(places[i] + arm)
        spins.append(spins[i] + turns[i] @ axis * float(rate))
        speeds.append(speeds[i] + np.cross(spins[i], arm))
    masses = np.array([part.mass for part in PARTS])
    arms = np.array([R @ np.array(part.com) for R, part in zip(turns, PARTS, strict=True)])
    centres, rates = np.array(places) + arms, np.array(speeds) + np.cross(np.array(spins), arms)
    centres = centres - masses @ centres / masses.sum()
    rates = rates - masses @ rates / masses.sum()
    own = sum(
        R @ (np.array(part.inertia) * (R.T @ w))
        for R, w, part in zip(turns, spins, PARTS, strict=True)
    )
    return own + masses @ np.cross(centres, rates)


def rotation_matrix(q_xyzw):
    """(3, 3) base to inertial coordinates."""
    x, y, z, w = np.asarray(q_xyzw) / np.linalg.norm(q_xyzw)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def _turn(axis, angle):
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def _words(values) -> str:
    return ' '.join(repr(float(v)) for v in values)


def _mjcf_body(index: int) -> str:
    part = PARTS[index]
    joint = (
        f'<joint name="j_{part.name}" type="hinge" axis="{_words(part.axis)}"/>'
        if index
        else '<freejoint/>'
    )
    children = ''.join(_mjcf_body(i) for i, p in enumerate(PARTS) if p.parent == index)
    return (
        f'<body name="{part.name}" pos="{_words(part.origin)}">{joint}'
        f'<inertial pos="{_words(part.com)}" mass="{part.mass!r}" '
        f'diaginertia="{_words(part.inertia)}"/>{children}</body>'
    )

"""Robots as plain lists of parts: their URDF, MJCF, and momentum from first principles.

The oracles share no code with the product; only `robot_of` calls it, to load a model.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.settings import Settings, parse_settings

AXIS = {
    'x': np.array([1.0, 0.0, 0.0]),
    'y': np.array([0.0, 1.0, 0.0]),
    'z': np.array([0.0, 0.0, 1.0]),
}
WHEEL_MASS, WHEEL_SPIN, WHEEL_TRANSVERSE = 10.0, 0.1, 0.06  # kg, kg m^2, kg m^2
H_BASE = np.array([25.0, 27.0, 28.0])  # N m s
H_TARGET = np.array([42.0, 49.0, 41.0])  # N m s
ATTITUDE_XYZW = np.array([0.2, 0.1, 0.3, 0.927]) / np.linalg.norm([0.2, 0.1, 0.3, 0.927])
OMEGA = np.array([0.1, 0.12, 0.08])  # rad/s


@dataclass(frozen=True)
class Part:
    """One link and the joint that carries it; the first part is the base."""

    name: str
    parent: int
    kind: str  # base | revolute | continuous | prismatic | fixed
    mass: float
    com: np.ndarray
    inertia: np.ndarray  # about the centre of mass
    axis: np.ndarray = field(default_factory=lambda: AXIS['x'])
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def joint(self) -> str:
        return f'j_{self.name}'


def table_one(axes: str = 'zyx') -> list[Part]:
    """The robot of Table I: a base and three links, wheels locked into base and link 3."""
    parts = [Part('base_link', -1, 'base', 2000.0, np.zeros(3), np.diag([1500.0] * 3))]
    rows = [
        (50.0, 0.25, (0.1, 11.0, 11.0)),
        (100.0, 1.0, (0.1, 33.0, 33.0)),
        (500.0, 1.0, (400.0, 300.0, 350.0)),
    ]
    origins = [np.array([0.5, 0.5, 1.0]), np.array([0.5, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])]
    for k, (mass, arm, moments) in enumerate(rows):
        com = np.array([arm, 0.0, 0.0])
        parts.append(
            Part(
                f'link_{k + 1}',
                k,
                'continuous',
                mass,
                com,
                np.diag(moments),
                AXIS[axes[k]],
                origins[k],
            )
        )
    return parts


def with_wheels(parts: list[Part], carriers: tuple[int, ...] = (0, 3)) -> list[Part]:
    """Three explicit wheels at every carrier's centre of mass, taken out of its inertia.

    Wheels are named `wheel_<carrier>_<axis>` and stand at the end of the list.
    """
    wheel = {
        a: np.diag([WHEEL_SPIN if a == b else WHEEL_TRANSVERSE for b in 'xyz']) for a in 'xyz'
    }
    out = list(parts)
    for c in carriers:
        host = parts[c]
        out[c] = replace(
            host, mass=host.mass - 3 * WHEEL_MASS, inertia=host.inertia - sum(wheel.values())
        )
        out += [
            Part(
                f'wheel_{c}_{a}',
                c,
                'continuous',
                WHEEL_MASS,
                np.zeros(3),
                tensor,
                AXIS[a],
                host.com,
            )
            for a, tensor in wheel.items()
        ]
    return out


def random_inertia(rng: np.random.Generator, scale: float = 1.0) -> np.ndarray:
    """A physical tensor: tr(S) 1 - S with S the second moment of a random mass distribution."""
    L = rng.standard_normal((3, 3))
    S = scale * (L @ L.T + 0.1 * np.eye(3))
    return np.trace(S) * np.eye(3) - S


def random_tree(
    rng: np.random.Generator, parents: list[int], prismatic: tuple[int, ...] = ()
) -> list[Part]:
    """A tree of random bodies, axes and placements.

    Args:
        parents: Parent index of part 1, 2, ...; part 0 is the base.
        prismatic: Indices of the parts that slide.
    """
    parts = [
        Part('base_link', -1, 'base', 50.0, rng.uniform(-0.3, 0.3, 3), random_inertia(rng, 5.0))
    ]
    for i, parent in enumerate(parents, start=1):
        axis = rng.standard_normal(3)
        parts.append(
            Part(
                f'link_{i}',
                parent,
                'prismatic' if i in prismatic else 'continuous',
                rng.uniform(2.0, 10.0),
                rng.uniform(-0.5, 0.5, 3),
                random_inertia(rng),
                axis / np.linalg.norm(axis),
                rng.uniform(-1.0, 1.0, 3),
                tuple(rng.uniform(-1.0, 1.0, 3)),
            )
        )
    return parts


DUAL_ARM = [0, 1, 2, 0, 4, 5]
WHEELS = {
    'servicer_wheels': {'momentum': [25.0, 27.0, 28.0]},
    'target_wheels': {
        'links': ['link_2', 'link_1'],
        'momentum': [42.0, 49.0, 41.0, -3.0, 5.0, 2.0],
    },
}
TREES = {
    'one joint': ([0], (), {}),
    'dual arm': (DUAL_ARM, (), WHEELS),
    'slides': ([0, 1, 2, 1], (2, 4), WHEELS),
    'seven joints': ([0, 1, 2, 3, 4, 5, 6], (4,), WHEELS),
    'fixed base': ([0, 1, 2, 0], (3,), {**WHEELS, 'base': 'fixed', 'gravity': [0.3, 1.0, -9.8]}),
}
"""Parents of the bodies, numbers of the joints that slide, options of `robot_of`."""


def to_urdf(parts: list[Part]) -> str:
    """URDF text; numbers in full precision."""
    lines = ['<robot name="test">']
    for part in parts:
        t = part.inertia
        moments = {
            'ixx': t[0, 0],
            'ixy': t[0, 1],
            'ixz': t[0, 2],
            'iyy': t[1, 1],
            'iyz': t[1, 2],
            'izz': t[2, 2],
        }
        inertia = ' '.join(f'{k}="{float(v)!r}"' for k, v in moments.items())
        lines.append(
            f'<link name="{part.name}"><inertial><origin xyz="{_text(part.com)}"/>'
            f'<mass value="{float(part.mass)!r}"/><inertia {inertia}/></inertial></link>'
        )
    for part in parts[1:]:
        parent = parts[part.parent].name
        lines.append(
            f'<joint name="{part.joint}" type="{part.kind}"><parent link="{parent}"/>'
            f'<child link="{part.name}"/><axis xyz="{_text(part.axis)}"/>'
            f'<origin xyz="{_text(part.origin)}" rpy="{_text(part.rpy)}"/></joint>'
        )
    return '\n'.join([*lines, '</robot>'])


def to_mjcf(
    parts: list[Part],
    dt: float,
    *,
    free: bool = True,
    gravity: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> str:
    """MuJoCo model with RK4, contacts off, one motor a joint in the order of the parts."""

    def body(index: int) -> str:
        part = parts[index]
        joint = '<freejoint/>' if free and index == 0 else ''
        if index:
            kind = 'slide' if part.kind == 'prismatic' else 'hinge'
            joint = f'<joint name="{part.joint}" type="{kind}" axis="{_text(part.axis)}"/>'
        t = part.inertia
        full = _text([t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]])
        children = ''.join(body(i) for i, p in enumerate(parts) if p.parent == index)
        return (
            f'<body name="{part.name}" pos="{_text(part.origin)}" euler="{_text(part.rpy)}">'
            f'{joint}<inertial pos="{_text(part.com)}" mass="{float(part.mass)!r}" '
            f'fullinertia="{full}"/>{children}</body>'
        )

    motors = ''.join(f'<motor joint="{part.joint}"/>' for part in parts[1:])
    return (
        '<mujoco><compiler angle="radian" eulerseq="XYZ"/>'
        f'<option timestep="{dt!r}" gravity="{_text(gravity)}" integrator="RK4">'
        '<flag contact="disable" constraint="disable"/></option>'
        f'<worldbody>{body(0)}</worldbody><actuator>{motors}</actuator></mujoco>'
    )


@cache
def to_rotation(rpy: tuple[float, float, float]) -> np.ndarray:
    """Rotation matrix of URDF's fixed-axis roll, pitch, yaw."""
    r, p, y = rpy
    return turn(AXIS['z'], y) @ turn(AXIS['y'], p) @ turn(AXIS['x'], r)


def turn(axis: np.ndarray, angle: float | np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) by Rodrigues' formula; angle (...)."""
    K = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    angle = np.asarray(angle)[..., None, None]
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def quaternion_matrix(xyzw: np.ndarray) -> np.ndarray:
    """Rotation matrix of a unit quaternion, written as q v q* by hand."""
    e, w = np.asarray(xyzw[:3]), float(xyzw[3])
    E = np.array([[0.0, -e[2], e[1]], [e[2], 0.0, -e[0]], [-e[1], e[0], 0.0]])
    return (w * w - e @ e) * np.eye(3) + 2.0 * np.outer(e, e) + 2.0 * w * E


@dataclass(frozen=True)
class Motion:
    """Base pose and velocity, joint positions and rates by joint name."""

    R_WB: np.ndarray
    p_WB: np.ndarray
    omega_W: np.ndarray
    v_W: np.ndarray
    q: dict[str, float]
    qd: dict[str, float]


def momentum_and_energy(parts: list[Part], motion: Motion) -> tuple[np.ndarray, np.ndarray, float]:
    """Linear and angular momentum (about the centre of mass, inertial frame), kinetic energy.

    Sums over the bodies, each placed by its parent: no spatial algebra, no mass matrix.
    """
    R, p, w, v = [motion.R_WB], [motion.p_WB], [motion.omega_W], [motion.v_W]
    for part in parts[1:]:
        i = part.parent
        q, qd = motion.q[part.joint], motion.qd[part.joint]
        frame = R[i] @ to_rotation(part.rpy)
        slide = part.kind == 'prismatic'
        R.append(frame if slide else frame @ turn(part.axis, q))
        d = R[i] @ part.origin + (frame @ part.axis * q if slide else 0.0)
        p.append(p[i] + d)
        w.append(w[i] if slide else w[i] + frame @ part.axis * qd)
        v.append(v[i] + np.cross(w[i], d) + (frame @ part.axis * qd if slide else 0.0))
    masses = np.array([part.mass for part in parts])
    arms = [R[k] @ part.com for k, part in enumerate(parts)]
    c = np.array([p[k] + arm for k, arm in enumerate(arms)])
    cd = np.array([v[k] + np.cross(w[k], arm) for k, arm in enumerate(arms)])
    C, Cd = masses @ c / masses.sum(), masses @ cd / masses.sum()
    H, T = np.zeros(3), 0.0
    for k, part in enumerate(parts):
        tensor = R[k] @ part.inertia @ R[k].T
        H += tensor @ w[k] + part.mass * np.cross(c[k] - C, cd[k] - Cd)
        T += 0.5 * w[k] @ tensor @ w[k] + 0.5 * part.mass * cd[k] @ cd[k]
    return masses.sum() * Cd, H, T


def settings_of(parts: list[Part], joints: list[str] | None = None, **robot: Any) -> Settings:
    """Settings of a robot made of parts; `robot` overrides entries of its section."""
    moving = [p.joint for p in parts[1:] if p.kind != 'fixed' and not p.name.startswith('wheel')]
    return parse_settings({'robot': {'joints': joints or moving, **robot}})


def robot_of(parts: list[Part], joints: list[str] | None = None, **robot: Any) -> Robot:
    """The product's robot made of parts."""
    return build_robot(settings_of(parts, joints, **robot), to_urdf(parts))


def wheel_joints(carrier: int) -> list[str]:
    """Names of a carrier's wheel joints, in the order of their axes."""
    return [f'j_wheel_{carrier}_{a}' for a in 'xyz']


def _text(values: Any) -> str:
    return ' '.join(repr(float(v)) for v in values)

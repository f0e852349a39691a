"""Robots of the truth generator: URDF, what the robot file says of them, and a start."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SERVICER = Path(__file__).resolve().parents[2] / 'config' / 'servicer.urdf'
AXES = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}


@dataclass(frozen=True)
class TruthRobot:
    """A robot.

    Args:
        urdf: Its text.
        joints: Measured joints.
        base_link: Root link.
        free: Free or fixed base.
        gravity: [m/s^2].
        servicer_wheels: Momentum of its own wheels [N m s].
        target_link: Link with the captured wheels; empty: none.
        target_wheels: What the robot file believes of them [N m s].
        q0: Joints at the start [rad].
        omega: Base rate at the start [rad/s].
        attitude_xyzw: Base attitude at the start.
        effort_std: Of its torque sensors [N m].
    """

    urdf: str
    joints: tuple[str, ...]
    base_link: str = 'base_link'
    free: bool = True
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    servicer_wheels: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target_link: str = ''
    target_wheels: tuple[float, float, float] = (0.0, 0.0, 0.0)
    q0: tuple[float, ...] = ()
    omega: tuple[float, float, float] = (0.0, 0.0, 0.0)
    attitude_xyzw: tuple[float, float, float, float] = field(default=(0.2, 0.1, 0.3, 0.927))
    effort_std: float = 0.05

    def yaml(self, urdf_name: str, stds: dict[str, float]) -> str:
        """The robot file."""
        lines = [
            '/**:',
            '  ros__parameters:',
            '    robot:',
            f'      urdf: {urdf_name}',
            f'      base: {"free" if self.free else "fixed"}',
            f'      base_link: {self.base_link}',
            f'      gravity: {list(map(float, self.gravity))}',
            f'      joints: [{", ".join(self.joints)}]',
        ]
        if self.free:
            lines.append(
                f'      servicer_wheels: {{momentum: {list(map(float, self.servicer_wheels))}}}'
            )
        if self.target_link:
            lines.append(
                f'      target_wheels: {{links: [{self.target_link}], '
                f'momentum: {list(map(float, self.target_wheels))}}}'
            )
        lines += ['    sensors:', *(f'      {name}: {std!r}' for name, std in stds.items())]
        return '\n'.join(lines) + '\n'


def chain(name: str, base: str, rows: list[tuple[str, str, str, float, str, str]]) -> str:
    """URDF of a serial arm.

    Args:
        name: Of the robot.
        base: Inertial of the base link, or empty.
        rows: Joint origin, axis, centre of mass, mass, moments, effort limit of each link.
    """
    parts = [f'<robot name="{name}">', f'<link name="base_link">{base}</link>']
    for k, (origin, axis, com, mass, moments, effort) in enumerate(rows, start=1):
        parent = 'base_link' if k == 1 else f'link_{k - 1}'
        parts.append(f'<link name="link_{k}">{inertial(com, mass, moments)}</link>')
        parts.append(
            f'<joint name="joint_{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{k}"/><origin xyz="{origin}"/><axis xyz="{AXES[axis]}"/>'
            f'<limit lower="-6" upper="6" effort="{effort}" velocity="3"/></joint>'
        )
    return '\n'.join([*parts, '</robot>'])


def inertial(com: str, mass: float, moments: str) -> str:
    """URDF inertial with a diagonal tensor."""
    xx, yy, zz = moments.split()
    return (
        f'<inertial><origin xyz="{com}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


SIXDOF = chain(
    'sixdof',
    inertial('0.02 -0.01 0.03', 420.0, '90 110 100'),
    [
        ('0.5 0.1 0.3', 'z', '0 0 0.1', 12.0, '0.12 0.12 0.06', '300'),
        ('0 0 0.2', 'y', '0.4 0.02 0', 18.0, '0.1 1.1 1.1', '300'),
        ('0.9 0 0', 'y', '0.35 0 0.02', 14.0, '0.08 0.8 0.8', '300'),
        ('0.8 0 0', 'x', '0.05 0.01 0', 6.0, '0.03 0.04 0.04', '100'),
        ('0.15 0 0', 'y', '0.05 0 0.01', 5.0, '0.02 0.03 0.03', '100'),
        ('0.15 0 0', 'x', '0.5 0.05 -0.1', 120.0, '22 28 26', '100'),
    ],
)
GROUND = chain(
    'ground_arm',
    '',
    [
        ('0 0 0.3', 'z', '0 -0.02 0.1', 4.0, '0.03 0.03 0.015', '120'),
        ('0 0 0.2', 'y', '0.18 0.01 0', 4.0, '0.012 0.07 0.07', '120'),
        ('0.4 0 0', 'y', '0.15 0 0.01', 2.5, '0.006 0.035 0.035', '60'),
        ('0.35 0 0', 'x', '0.04 0.02 0', 1.2, '0.003 0.004 0.004', '30'),
    ],
)
PENDULUM = chain(
    'wheel_pendulum',
    '',
    [
        ('0 0 1', 'y', '0 0 -0.25', 1.5, '0.04 0.04 0.003', '5'),
        ('0 0 -0.4', 'y', '0 0 0', 0.8, '0.0012 0.0022 0.0012', '2'),
    ],
)

ROBOTS = {
    'servicer': TruthRobot(
        SERVICER.read_text(encoding='utf-8'),
        ('joint_1', 'joint_2', 'joint_3'),
        servicer_wheels=(25.0, 27.0, 28.0),
        target_link='link_3',
        target_wheels=(42.0, 49.0, 41.0),
        q0=(0.3, -0.5, 0.4),
        omega=(0.1, 0.12, 0.08),
    ),
    'sixdof': TruthRobot(
        SIXDOF,
        tuple(f'joint_{k}' for k in range(1, 7)),
        servicer_wheels=(4.0, -6.0, 5.0),
        target_link='link_6',
        target_wheels=(-7.0, 5.0, 11.0),
        q0=(0.2, -0.7, 1.3, 0.4, 0.6, -0.3),
        omega=(0.02, -0.03, 0.025),
    ),
    'ground': TruthRobot(
        GROUND,
        tuple(f'joint_{k}' for k in range(1, 5)),
        free=False,
        gravity=(0.0, 0.0, -9.81),
        q0=(0.2, -0.4, 0.9, 0.3),
        effort_std=0.02,
    ),
    'pendulum': TruthRobot(
        PENDULUM,
        ('joint_1', 'joint_2'),
        free=False,
        gravity=(0.0, 0.0, -9.81),
        q0=(0.2, 0.0),
        effort_std=0.002,
    ),
}


def unit(xyzw: tuple[float, ...]) -> np.ndarray:
    """A unit quaternion."""
    q = np.array(xyzw)
    return q / np.linalg.norm(q)

"""URDF of serial arms."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

AXES = {'x': '1 0 0', 'y': '0 1 0', 'z': '0 0 1'}


def chain(links: Iterable[tuple[Any, ...]], reach: float = 6.0, velocity: float = 3.0) -> str:
    """An arm on a base without mass; links and joints are counted from 1.

    Args:
        links: Of each joint origin [m], axis, and of its link centre of mass [m], mass [kg],
            moments about that [kg m^2]; effort limit.
        reach: Limit of every angle [rad].
        velocity: Limit of every rate [rad/s].
    """
    parts, parent = ['<robot name="arm"><link name="base_link"/>'], 'base_link'
    for k, (origin, axis, com, mass, moments, effort) in enumerate(links, 1):
        xx, yy, zz = moments.split()
        parts.append(
            f'<link name="link_{k}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
            f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f'</link><joint name="joint_{k}" type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{k}"/><origin xyz="{origin}"/><axis xyz="{AXES[axis]}"/>'
            f'<limit lower="{-reach}" upper="{reach}" effort="{effort}" velocity="{velocity}"/>'
            '</joint>'
        )
        parent = f'link_{k}'
    return '\n'.join([*parts, '</robot>'])

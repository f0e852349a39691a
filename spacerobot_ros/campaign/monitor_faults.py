"""Faults that set in during a flight, each with a size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..sensing.sensors import SensorSamples
from .monitor_flights import Flight

_TIP = 0.5  # m from the last link's origin to a payload
_LEVER = {'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4}  # m, of the thruster


def _no_effect(size: float, link: str) -> dict[str, Any]:
    return {}


def _no_change(measured: SensorSamples, size: float) -> SensorSamples:
    return measured


@dataclass(frozen=True, slots=True)
class Fault:
    """A kind of fault.

    Args:
        unit: Of its size.
        sizes: Worth flying, the largest last.
        channels: Beginnings of the names that may speak first.
        effect: Entry of `effects:` by the size and the name of the last link; empty for none.
        change: What the sensors say then, by the size.
        robots: Robots that can have it.
    """

    unit: str
    sizes: tuple[float, ...]
    channels: tuple[str, ...]
    effect: Callable[[float, str], dict[str, Any]] = _no_effect
    change: Callable[[SensorSamples, float], SensorSamples] = _no_change
    robots: tuple[str, ...] = ('servicer', 'minisat')


def in_flight(name: str, size: float, flight: Flight) -> Flight:
    """The flight with a fault of a size from its `onset` to its `end`."""
    fault = FAULTS[name]
    entry = fault.effect(size, flight.file.robot.bodies[-1].name)
    effects = {'fault': entry} if entry else {}
    return replace(flight, effects=effects, change=lambda measured: fault.change(measured, size))


def _payload(size: float, link: str) -> dict[str, Any]:
    second = _TIP**2 * size
    moments = {'mass': size, 'mx': _TIP * size, 'iyy': second, 'izz': second}
    return {'effect': 'inertial_parameters', 'where': link, **moments}


def _drag(size: float, link: str) -> dict[str, Any]:
    return {'effect': 'target_wheel_drag', 'where': link, 'time_constant': 1.0 / size}


def _gyro_bias(measured: SensorSamples, size: float) -> SensorSamples:
    if measured.omega is None:
        return measured
    return replace(measured, omega=measured.omega + np.array([size, 0.0, 0.0]))


def _star_turned(measured: SensorSamples, size: float) -> SensorSamples:
    if measured.attitude_xyzw is None:
        return measured
    turn = Rotation.from_rotvec([0.0, size, 0.0])
    turned = Rotation.from_quat(measured.attitude_xyzw) * turn
    return replace(measured, attitude_xyzw=turned.as_quat())


FAULTS = {
    'coulomb_friction': Fault(
        'N m',
        (0.03, 0.1, 0.3, 1.0),
        ('joint_2 torque',),
        lambda size, _: {'effect': 'joint_coulomb_friction', 'where': 'joint_2', 'torque': size},
    ),
    'payload': Fault('kg', (0.5, 2.0, 10.0), ('joint', 'angular momentum'), _payload),
    'gyro_bias': Fault('rad/s', (1e-5, 5e-5, 2e-4, 1e-3), ('gyro x',), change=_gyro_bias),
    'star_turned': Fault('rad', (1e-4, 1e-3, 1e-2), ('attitude y',), change=_star_turned),
    'thruster_leak': Fault(
        'N',
        (0.003, 0.01, 0.1),
        ('angular momentum',),
        lambda size, _: {'effect': 'thruster_leak', 'force_y': size, **_LEVER},
    ),
    'wheel_drag': Fault(
        '1/s', (1e-4, 1e-3, 3e-3), ('joint', 'angular momentum'), _drag, robots=('servicer',)
    ),
}
"""Every fault by its name."""

"""Faults that set in during a flight, each with a size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .monitor_flights import Flight, Sample

_TIP = 0.5  # m from the last link's origin to a payload
_LEVER = {'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4}  # m, of the thruster


@dataclass(frozen=True, slots=True)
class Fault:
    """A kind of fault.

    Args:
        unit: Of its size.
        sizes: Worth flying, the largest last.
        make: Flight with the fault of a size.
        channels: Beginnings of the names that may speak first.
        robots: Robots that can have it.
    """

    unit: str
    sizes: tuple[float, ...]
    make: Callable[[Flight, float], Flight]
    channels: tuple[str, ...]
    robots: tuple[str, ...] = ('servicer', 'minisat')


def in_flight(name: str, size: float, flight: Flight) -> Flight:
    """The flight with a fault of a size from its `onset` to its `end`."""
    return FAULTS[name].make(flight, size)


def _last_link(flight: Flight) -> str:
    return flight.file.robot.bodies[-1].name


def _friction(flight: Flight, size: float) -> Flight:
    effect = {'effect': 'joint_coulomb_friction', 'where': 'joint_2', 'torque': size}
    return replace(flight, effects={'fault': effect})


def _drag(flight: Flight, size: float) -> Flight:
    where = _last_link(flight)
    effect = {'effect': 'target_wheel_drag', 'where': where, 'time_constant': 1.0 / size}
    return replace(flight, effects={'fault': effect})


def _leak(flight: Flight, size: float) -> Flight:
    effect = {'effect': 'thruster_leak', 'force_y': size, **_LEVER}
    return replace(flight, effects={'fault': effect})


def _payload(flight: Flight, size: float) -> Flight:
    second = _TIP**2 * size
    effect = {
        'effect': 'inertial_parameters',
        'where': _last_link(flight),
        'mass': size,
        'mx': _TIP * size,
        'iyy': second,
        'izz': second,
    }
    return replace(flight, effects={'fault': effect})


def _gyro_bias(flight: Flight, size: float) -> Flight:
    def change(sample: Sample) -> Sample:
        if sample.omega is None:
            return sample
        return replace(sample, omega=sample.omega + np.array([size, 0.0, 0.0]))

    return replace(flight, change=change)


def _star_turned(flight: Flight, size: float) -> Flight:
    turn = Rotation.from_rotvec([0.0, size, 0.0])

    def change(sample: Sample) -> Sample:
        if sample.attitude_xyzw is None:
            return sample
        turned = Rotation.from_quat(sample.attitude_xyzw) * turn
        return replace(sample, attitude_xyzw=turned.as_quat())

    return replace(flight, change=change)


FAULTS = {
    'coulomb_friction': Fault('N m', (0.03, 0.1, 0.3, 1.0), _friction, ('joint_2 torque',)),
    'payload': Fault('kg', (0.5, 2.0, 10.0), _payload, ('joint', 'angular momentum')),
    'gyro_bias': Fault('rad/s', (1e-5, 5e-5, 2e-4, 1e-3), _gyro_bias, ('gyro x',)),
    'star_turned': Fault('rad', (1e-4, 1e-3, 1e-2), _star_turned, ('attitude y',)),
    'thruster_leak': Fault('N', (0.003, 0.01, 0.1), _leak, ('angular momentum',)),
    'wheel_drag': Fault(
        '1/s', (1e-4, 1e-3, 3e-3), _drag, ('joint', 'angular momentum'), ('servicer',)
    ),
}
"""Every fault by its name."""

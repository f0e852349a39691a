"""Faults that set in during a flight, each with a size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .flights import Flight, Sample


@dataclass(frozen=True)
class Fault:
    """A kind of fault.

    Args:
        unit: Of its size.
        sizes: Worth flying.
        make: Flight with the fault of a size.
        channels: Beginnings of the names that may speak first.
    """

    unit: str
    sizes: tuple[float, ...]
    make: Callable[[Flight, float], Flight]
    channels: tuple[str, ...]


def _effect(id_: str, where: str | None, name: str) -> Callable[[Flight, float], Flight]:
    def make(flight: Flight, size: float) -> Flight:
        entry = {'effect': id_, name: size}
        if where is not None:
            entry['where'] = where
        return replace(flight, effects={'fault': entry})

    return make


def _drag(flight: Flight, size: float) -> Flight:
    link = {'servicer': 'link_3', 'sixdof': 'link_6'}[flight.robot]
    effect = {'effect': 'target_wheel_drag', 'where': link, 'time_constant': 1.0 / size}
    return replace(flight, effects={'fault': effect})


def _leak(flight: Flight, size: float) -> Flight:
    effect = {
        'effect': 'thruster_leak', 'force_x': 0.0, 'force_y': size, 'force_z': 0.0,
        'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4,
    }  # fmt: skip
    return replace(flight, effects={'fault': effect})


def _payload(flight: Flight, size: float) -> Flight:
    link = {'servicer': 'link_3', 'sixdof': 'link_6', 'ground': 'link_4'}[flight.robot]
    effect = {'effect': 'inertial_parameters', 'where': link, 'mass': size, 'mx': 0.5 * size}
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
    'coulomb_friction': Fault(
        'N m', (0.03, 0.1, 0.3, 1.0),
        _effect('joint_coulomb_friction', 'joint_2', 'torque'), ('joint_2 torque',),
    ),
    'payload': Fault('kg', (0.5, 2.0, 10.0), _payload, ('joint', 'angular momentum')),
    'gyro_bias': Fault('rad/s', (1e-5, 5e-5, 2e-4, 1e-3), _gyro_bias, ('gyro x',)),
    'star_turned': Fault('rad', (1e-4, 1e-3, 1e-2), _star_turned, ('attitude y',)),
    'thruster_leak': Fault('N', (0.003, 0.01, 0.1), _leak, ('angular momentum',)),
    'wheel_drag': Fault('1/s', (1e-4, 1e-3, 3e-3), _drag, ('joint', 'angular momentum')),
}  # fmt: skip


def in_flight(name: str, size: float, flight: Flight) -> Flight:
    """The flight with a fault."""
    return FAULTS[name].make(flight, size)

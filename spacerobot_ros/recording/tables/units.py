"""What columns measure, and its units: the known ones, and their size in SI."""

from __future__ import annotations

import math

from ...errors import RecordingError, did_you_mean

TIME, ANGLE, LENGTH = 'time', 'angle', 'length'
ANGULAR_RATE, LINEAR_RATE = 'angular rate', 'linear rate'
TORQUE, FORCE, CURRENT, FIELD = 'torque', 'force', 'current', 'magnetic field'

_DEG = math.pi / 180.0
_TURN = 2.0 * math.pi

# Torques and forces of the pound and the ounce: exact by definition (1 lbf = 4.4482216152605 N).
_SIZES: dict[str, dict[str, float]] = {
    TIME: {'s': 1.0, 'ms': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'min': 60.0, 'h': 3600.0},
    ANGLE: {'rad': 1.0, 'mrad': 1e-3, 'deg': _DEG, 'arcsec': _DEG / 3600.0, 'turn': _TURN},
    LENGTH: {'m': 1.0, 'mm': 1e-3, 'cm': 1e-2, 'um': 1e-6},
    ANGULAR_RATE: {
        **{'rad/s': 1.0, 'mrad/s': 1e-3, 'deg/s': _DEG, 'deg/h': _DEG / 3600.0},
        **{'arcsec/s': _DEG / 3600.0, 'rpm': _TURN / 60.0, 'turn/s': _TURN},
    },
    LINEAR_RATE: {'m/s': 1.0, 'mm/s': 1e-3, 'cm/s': 1e-2},
    TORQUE: {
        **{'N m': 1.0, 'mN m': 1e-3, 'uN m': 1e-6, 'kN m': 1e3, 'N cm': 1e-2, 'N mm': 1e-3},
        **{'kgf cm': 0.0980665, 'lbf ft': 1.3558179483314004},
        **{'lbf in': 0.1129848290276167, 'ozf in': 0.007061551814226043},
    },
    FORCE: {'N': 1.0, 'mN': 1e-3, 'kN': 1e3, 'lbf': 4.4482216152605},
    CURRENT: {'A': 1.0, 'mA': 1e-3},
    FIELD: {'T': 1.0, 'mT': 1e-3, 'uT': 1e-6, 'nT': 1e-9, 'G': 1e-4, 'mG': 1e-7},
}
SI_UNITS = {quantity: next(iter(sizes)) for quantity, sizes in _SIZES.items()} | {'': ''}
"""By quantity: the first one of each is of size 1."""
_XYZ = ('x', 'y', 'z')
INPUTS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    'base_wrench': (
        tuple(f'{what}_{axis}' for what in ('force', 'torque') for axis in _XYZ),
        (FORCE,) * 3 + (TORQUE,) * 3,
    ),
    'magnetic_field': (_XYZ, (FIELD,) * 3),
    'base_position': (_XYZ, (LENGTH,) * 3),
}
"""Columns and quantities of inputs whose meaning is known, beside the thrusters' commands."""
_ALIASES = {'Nm': 'N m', 'mNm': 'mN m', 'kNm': 'kN m', 'Ncm': 'N cm', 'Nmm': 'N mm'}


def is_current(unit: str) -> bool:
    """Whether it is a unit of current."""
    return unit in _SIZES[CURRENT]


def si_size(unit: str, quantity: str, place: str) -> float:
    """Size of a unit in SI.

    Args:
        unit: Such as `deg/s`; `Nm` for `N m` is understood.
        quantity: What the column measures, one of this module's constants.
        place: Where the unit is written, for the error.

    Raises:
        RecordingError: an unknown unit, or one of another quantity.
    """
    name = _ALIASES.get(unit, unit)
    known = _SIZES[quantity]
    if name in known:
        return known[name]
    other = next((q for q, sizes in _SIZES.items() if name in sizes), None)
    if other is not None:
        raise RecordingError(place, f'{unit!r} is a unit of {other}, expected one of {quantity}')
    hint = did_you_mean(name, known, f'known: {", ".join(known)}')
    raise RecordingError(place, f'unknown unit {unit!r} of {quantity} ({hint})')

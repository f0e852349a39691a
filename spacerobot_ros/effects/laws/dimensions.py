"""Units as text, such as `N m s/rad` or `kg m^2`: their words, and those in base units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...errors import ConfigurationError

Dimension = tuple[float, ...]
"""Powers of kg, m, s, A, K, T."""
_BASE = ('kg', 'm', 's', 'A', 'K', 'T')
PURE: Dimension = (0.0,) * len(_BASE)
"""Of a pure number."""
_UNITS: Mapping[str, Dimension] = {
    **{name: tuple(float(name == base) for base in _BASE) for name in _BASE},
    **dict.fromkeys(('rad', '1', '%'), PURE),
    'degC': (0.0, 0.0, 0.0, 0.0, 1.0, 0.0),
    'N': (1.0, 1.0, -2.0, 0.0, 0.0, 0.0),
    'J': (1.0, 2.0, -2.0, 0.0, 0.0, 0.0),
    'W': (1.0, 2.0, -3.0, 0.0, 0.0, 0.0),
    'Pa': (1.0, -1.0, -2.0, 0.0, 0.0, 0.0),
    'Hz': (0.0, 0.0, -1.0, 0.0, 0.0, 0.0),
    'V': (1.0, 2.0, -3.0, -1.0, 0.0, 0.0),
}


def powers_of(unit: str) -> dict[str, float]:
    """Power of every word of a unit; what follows a `/` divides, brackets or none.

    Raises:
        ValueError: a power that is no number.
    """
    total: dict[str, float] = {}
    for k, part in enumerate(unit.replace('(', ' ').replace(')', ' ').split('/')):
        for word in part.split():
            name, _, power = word.partition('^')
            own = float(power or 1.0)
            total[name] = total.get(name, 0.0) + (own if k == 0 else -own)
    return total


def unit_text(powers: Mapping[str, float]) -> str:
    """Words with these powers as a unit; empty where all are zero."""
    up, down = (
        ' '.join(
            name if abs(power) == 1 else f'{name}^{abs(power):g}'
            for name, power in powers.items()
            if sign * power > 0
        )
        for sign in (1, -1)
    )
    return f'{up or 1}/{down}' if down else up


def dimension(unit: str, place: str) -> Dimension:
    """Powers of the base units of a unit.

    Args:
        unit: As text.
        place: Where it stands, for messages.

    Raises:
        ConfigurationError: a unit that is not SI.
    """
    try:
        words = [(np.array(_UNITS[name]), power) for name, power in powers_of(unit).items()]
    except (KeyError, ValueError):
        why = f'{unit!r} is no SI unit (of {", ".join(_UNITS)}, with / and ^)'
        raise ConfigurationError(place, why) from None
    return tuple(sum((own * power for own, power in words), np.array(PURE)).tolist())


def is_unit(unit: str) -> bool:
    """Whether a text is an SI unit."""
    try:
        dimension(unit, '')
    except ConfigurationError:
        return False
    return True


def in_words(powers: Dimension) -> str:
    """Base units with their powers."""
    return unit_text(dict(zip(_BASE, powers, strict=True))) or 'pure numbers'

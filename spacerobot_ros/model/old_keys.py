"""Keys of robot files that have others in their place now: still read, each with one line."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

_WIDTHS = ('mass', 'com', 'inertia')


def without_old_keys(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Parameters of a robot file in which old keys say what they said under their new names.

    `identifier.prior_std` and `adaptive.prior_std` are `robot.uncertainty` of all bodies, at most
    1, where that is not given; `identifier.manifold` has no meaning any more.
    """
    if not any(_has(values, *key) for key in _OLD):
        return values
    sections = {k: dict(v) if isinstance(v, Mapping) else v for k, v in values.items()}
    for section, key in _OLD:
        if not _has(values, section, key):
            continue
        value = sections[section].pop(key)
        if key == 'manifold':
            _say(f'{section}.{key}: is ignored; estimates are of physical bodies')
            continue
        robot = sections.get('robot')
        if not isinstance(robot, dict):
            continue  # refused, by name, whatever else there is
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if 'uncertainty' in robot or not (is_number and value > 0.0):
            _say(f'{section}.{key}: is ignored; robot.uncertainty is in its place')
        else:
            width = float(min(value, 1.0))
            robot['uncertainty'] = dict.fromkeys(_WIDTHS, width)
            _say(f'{section}.{key}: is read as robot.uncertainty {width:g} of all bodies')
    return sections


_OLD = (('identifier', 'prior_std'), ('adaptive', 'prior_std'), ('identifier', 'manifold'))


def _has(values: Mapping[str, Any], section: str, key: str) -> bool:
    part = values.get(section)
    return isinstance(part, Mapping) and key in part


def _say(line: str) -> None:
    logging.getLogger(__name__).warning('%s (docs/identification.md)', line)

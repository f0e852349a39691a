"""Keys of robot files that have others in their place now: still read, each with one line."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any


def without_old_keys(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """Parameters of a robot file in which old keys say what they said under their new names.

    `identifier.prior_std` and `adaptive.prior_std` are `robot.uncertainty` of all bodies, at most
    1, where that is not given; `identifier.manifold` has no meaning any more.
    """
    sections = {k: dict(v) if isinstance(v, Mapping) else v for k, v in values.items()}
    for section, key in _OLD:
        part, robot = sections.get(section), sections.get('robot')
        if not (isinstance(part, dict) and key in part):
            continue
        value = part.pop(key)
        is_width = isinstance(value, int | float) and not isinstance(value, bool) and value > 0.0
        if key == 'manifold':
            meaning = 'is ignored; estimates are of physical bodies'
        elif not isinstance(robot, dict):
            continue  # refused, by name, whatever else there is
        elif 'uncertainty' in robot or not is_width:
            meaning = 'is ignored; robot.uncertainty is in its place'
        else:
            width = float(min(value, 1.0))
            robot['uncertainty'] = dict.fromkeys(('mass', 'com', 'inertia'), width)
            meaning = f'is read as robot.uncertainty {width:g} of all bodies'
        line = '%s.%s: %s (docs/identification.md)'
        logging.getLogger(__name__).warning(line, section, key, meaning)
    return sections


_OLD = (('identifier', 'prior_std'), ('adaptive', 'prior_std'), ('identifier', 'manifold'))

"""The robot file with the effects that a diagnosis found: a model that every tool loads.

Nothing of the original is lost: its own effects stay, and the new ones come beside them under
names of their own. Corrected inertial parameters and wheel momentum are effects as well, so that
one mechanism carries everything that was learnt.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...effects.effect import Effect
from ...json_values import plain
from ...model.files import read_parameters, read_text, write_parameters, write_text
from ...model.loader import resolve_urdf

NEVER = 1e12
"""What a robot file says where a value is infinite, such as the time constant of no drag."""


def named(causes: Iterable[Effect], believed: Sequence[Effect]) -> tuple[Effect, ...]:
    """The causes under names that the robot file does not use yet."""
    return _under_free_names(causes, {effect.name for effect in believed})


def _under_free_names(causes: Iterable[Effect], taken: set[str]) -> tuple[Effect, ...]:
    out = []
    for cause in causes:
        name = _free_name(cause, taken)
        taken.add(name)
        out.append(replace(cause, name=name))
    return tuple(out)


def effects_section(effects: Iterable[Effect]) -> dict[str, dict[str, Any]]:
    """Effects as the `effects:` section of a robot file."""
    return {effect.name: _entry(effect) for effect in effects}


def write_extended_model(template: str | Path, causes: Iterable[Effect], path: str | Path) -> Path:
    """Write the robot file with further effects.

    A URDF with a relative path is copied beside the new file, under its name; a package's or an
    absolute path is kept.

    Args:
        template: The robot file.
        causes: Effects to add; each gets a name that is free.
        path: The YAML to write.

    Raises:
        ConfigurationError: the template can't be read or the files can't be written.
    """
    template, path = Path(template), Path(path)
    values = plain(read_parameters(template))
    own = values.get('effects') or {}
    values['effects'] = {**own, **effects_section(_under_free_names(causes, set(own)))}
    if not values['effects']:
        del values['effects']
    url = str(values['robot'].get('urdf', ''))
    if url and '://' not in url and not Path(url).is_absolute():
        text = read_text(resolve_urdf(url, beside=template.parent), 'robot.urdf')
        values['robot']['urdf'] = write_text(path.with_suffix('.urdf'), text).name
    return write_parameters(path, values, _head(template))


def _head(template: Path) -> str:
    return (
        f'# {template.name} extended by `spacerobot diagnose` (docs/diagnosis.md): what was found '
        'stands under effects,\n# the rest is unchanged.\n'
    )


def _free_name(cause: Effect, taken: set[str]) -> str:
    place = '' if cause.where is None else f'_{cause.where}'
    name = first = f'{cause.id}{place}'.replace('.', '_')
    count = 1
    while name in taken:
        count += 1
        name = f'{first}_{count}'
    return name


def _entry(effect: Effect) -> dict[str, Any]:
    place = {} if effect.where is None else {'where': effect.where}
    return {'effect': effect.id, **place, **_finite(effect.entry())}


def _finite(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: math.copysign(NEVER, value) if value in (math.inf, -math.inf) else value
        for name, value in plain(values).items()
    }

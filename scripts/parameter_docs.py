"""The page docs/parameters.md, written from the schema of `settings`.

python scripts/parameter_docs.py > docs/parameters.md
"""

from __future__ import annotations

import inspect
import sys
import typing
from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from typing import Any

from spacerobot_ros.model.schema import Allowed, meanings, plain_types
from spacerobot_ros.model.settings import Settings

_HEAD = """# Parameters

Every parameter of a robot file, the ROS 2 parameter file that all nodes and the command line share
(`config/servicer.yaml` is an example). Written from `spacerobot_ros/model/*settings.py` by
`python scripts/parameter_docs.py > docs/parameters.md`; a test fails when it is
stale.

Units are SI and radians. A parameter without a default is required. Unknown names, wrong types and
lengths, numbers out of bounds or not finite are refused with the parameter named.
"""
_EFFECTS = """
## `effects`

Physical effects that the model believes in beside robot and wheels: friction, sensor faults, other
masses. A map under free names; simulator, controller, identifier, monitor and diagnosis take it
alike. Ids, places and parameters: effects.md.

    effects:
      elbow_friction: {effect: joint_viscous_friction, where: joint_2, coefficient: 3.1}
      tracker_latency: {effect: attitude_delay, delay: 0.02}

## `firings`

Commands to the thrusters of `robot.thrusters` in a simulated run, under free names; without a
period once.

    firings:
      a: {thruster: T1, start: 1.0, width: 0.3, share: 1.0, period: 3.0}
"""
_KINDS = {float: 'number', int: 'whole number', str: 'text', bool: 'true or false'}


def parameter_page() -> str:
    """Markdown of docs/parameters.md."""
    parts = [_HEAD]
    for name, cls in _sections(Settings, ''):
        parts.append(f'\n## `{name}`\n\n{_docstring(cls)}\n')
        parts.append('\n| parameter | type | default | allowed | unit | meaning |\n')
        parts.append('|---|---|---|---|---|---|\n')
        hints, meaning = typing.get_type_hints(cls), meanings(cls)
        parts.extend(
            _row(f, plain_types(hints[f.name]), meaning[f.name]) for f in fields(cls) if f.metadata
        )
    return ''.join([*parts, _EFFECTS])


def _sections(cls: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    """Sections with parameters of their own, outer before inner."""
    for name, hint in typing.get_type_hints(cls).items():
        if hasattr(hint, '__dataclass_fields__'):
            yield prefix + name, hint
            yield from _sections(hint, f'{prefix}{name}.')


def _docstring(cls: type) -> str:
    return (inspect.getdoc(cls) or '').partition('\nArgs:\n')[0].strip()


def _row(f: Field[Any], kinds: tuple[Any, ...], meaning: str) -> str:
    allowed: Allowed = f.metadata['allowed']
    kind = ' or '.join(_kind(kind) for kind in kinds)
    cells = (f'`{f.name}`', kind, _default(f), ', '.join(allowed.limits), allowed.unit, meaning)
    return '| ' + ' | '.join(cell.replace('|', '\\|') for cell in cells) + ' |\n'


def _kind(kind: Any) -> str:
    if typing.get_origin(kind) is tuple:
        return f'list of {_KINDS[typing.get_args(kind)[0]]}s'.replace('texts', 'names')
    return _KINDS[kind]


def _default(f: Field[Any]) -> str:
    if f.default is MISSING:
        return 'required'
    if f.default is None or f.default in ((), ''):
        return 'none'
    if isinstance(f.default, tuple):
        return f'`[{", ".join(str(v) for v in f.default)}]`'
    return f'`{str(f.default).lower() if isinstance(f.default, bool) else f.default}`'


if __name__ == '__main__':
    sys.stdout.write(parameter_page())

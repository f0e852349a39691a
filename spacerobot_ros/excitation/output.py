"""The designed motion as a complete robot file, which every tool loads like its template."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import yaml

from ..errors import ConfigurationError
from ..model.files import read_parameters
from ..types import Array
from .family import MotionFamily
from .free_base import Start


class Designed(Protocol):
    """Where a designed motion comes from.

    Attributes:
        family: The family that its amplitudes belong to. start: How the base starts.
    """

    family: MotionFamily
    start: Start


_REFERENCE = ('kind', 'duration', 'harmonics', 'sine', 'cosine')


def write_trajectory(problem: Designed, x: Array, template: str | Path, path: str | Path) -> Path:
    """Write the robot file with the designed `reference`, and the base rate that it starts from.

    Everything else is kept; a relative `robot.urdf` is rewritten to be found from the new place.

    Args:
        problem: Has the family and the start.
        x: (size,) amplitudes of the motion [rad].
        template: The robot file.
        path: The file to write.

    Raises:
        ConfigurationError: the template can't be read or the file can't be written.
    """
    template, path = Path(template), Path(path)
    values = _plain(read_parameters(template))
    reference = asdict(problem.family.reference(x))
    values['reference'] = {key: _plain(reference[key]) for key in _REFERENCE}
    initial = dict(values.get('initial') or {})
    initial['angular_velocity'] = [float(w) for w in problem.start.omega]
    values['initial'] = initial
    _keep_urdf(values['robot'], template.parent, path.parent)
    text = yaml.safe_dump(
        {'/**': {'ros__parameters': values}}, sort_keys=False, default_flow_style=None
    )
    head = (
        '# Identification motion from `spacerobot excite` (docs/excitation.md): reference and\n'
        f'# initial.angular_velocity are designed, the rest is as in {template.name}.\n'
    )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(head + text, encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(str(path), f'can not be written: {error.strerror}') from error
    return path


def _keep_urdf(robot: dict[str, Any], old: Path, new: Path) -> None:
    urdf = str(robot.get('urdf', ''))
    if urdf and '://' not in urdf and not Path(urdf).is_absolute():
        robot['urdf'] = os.path.relpath(old / urdf, new)


def _plain(value: Any) -> Any:
    """Maps and lists that YAML writes without tags."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return value

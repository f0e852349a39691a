"""The designed motion as a complete robot file, which every tool loads like its template."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path

from ..model.files import read_parameters, write_parameters
from ..types import Array
from .motions import Motions

_REFERENCE = ('kind', 'duration', 'harmonics', 'sine', 'cosine')


def write_trajectory(motions: Motions, x: Array, template: str | Path, path: str | Path) -> Path:
    """Write the robot file with the designed `reference`, and the base rate that it starts from.

    Everything else is kept; a relative `robot.urdf` is rewritten to be found from the new place.

    Args:
        motions: Have the family and the start.
        x: (size,) amplitudes of the motion [rad].
        template: The robot file.
        path: The file to write.

    Raises:
        ConfigurationError: the template can't be read or the file can't be written.
    """
    template, path = Path(template), Path(path)
    values = dict(read_parameters(template))
    reference = asdict(motions.family.reference(x))
    values['reference'] = {key: reference[key] for key in _REFERENCE}
    omega = motions.start.omega.tolist()
    values['initial'] = {**(values.get('initial') or {}), 'angular_velocity': omega}
    urdf = str(values['robot'].get('urdf', ''))
    if urdf and '://' not in urdf and not Path(urdf).is_absolute():
        moved = os.path.relpath(template.parent / urdf, path.parent)
        values['robot'] = {**values['robot'], 'urdf': moved}
    head = (
        '# Identification motion from `spacerobot excite` (docs/excitation.md): reference and\n'
        f'# initial.angular_velocity are designed, the rest is as in {template.name}.\n'
    )
    return write_parameters(path, values, head)

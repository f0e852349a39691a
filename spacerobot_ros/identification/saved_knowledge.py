"""What an identifier knows, in a file that survives it: checked by sum, version and robot.

Time passes between saving and loading. The bodies stay; the captured wheels may have run down at
the rate that the catalogue calls plausible, by which what is known of them is widened.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.inference.square_root import marginal
from ..types import Array
from .checked_file import digest, read_checked, run_down, write_checked
from .estimate import Estimate
from .maximum_likelihood import Known
from .momentum_posterior import posterior_of
from .summary import estimated_values

VERSION = 2
_KEPT = ('rank', 'condition', 'chi2_per_dof', 'samples', 'stamp_ns', 'unexcited')


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """What an identifier knows.

    Args:
        model: Whose constants they are.
        known: Of wheels and bodies; where it was saved, widened for the time that passed.
        estimate: The same to be told, valid.
    """

    model: MomentumModel
    known: Known
    estimate: Estimate


def save(path: Path, knowledge: Knowledge, now_ns: int) -> None:
    """Write what is known, whole or not at all; the file before stays beside it.

    Args:
        path: The file.
        knowledge: What is known.
        now_ns: Wall time [ns].

    Raises:
        ConfigurationError: it can not be written.
    """
    model = knowledge.model
    robot = knowledge.known.of(slice(3, model.filter_bodies.stop))
    content = {
        **{name: getattr(robot, name).tolist() for name in _NUMBERS},
        **{name: getattr(knowledge.estimate, name) for name in _KEPT},
    }
    write_checked(path, VERSION, _fingerprint(model), content, now_ns)


_NUMBERS = ('best', 'factor', 'values')


def load(path: Path, now_ns: int, model: MomentumModel) -> Knowledge:
    """Read what was known: from the file, or where it is torn or gone from the one before.

    Raises:
        RecordingError: neither can be used, and why the first can not.
    """
    return read_checked(path, VERSION, _fingerprint(model), partial(_widened, model), now_ns)


def _widened(model: MomentumModel, content: dict[str, Any], seconds: float) -> Knowledge:
    part = slice(3, model.filter_bodies.stop)
    saved = Known(part, *(np.array(content[name], dtype=float) for name in _NUMBERS))
    size = part.stop - part.start
    shapes = [getattr(saved, name).shape for name in _NUMBERS]
    if shapes != [(model.size,), (size, size), (size,)]:
        raise ValueError(f'{shapes} numbers for {size} constants')
    known = _less_sure(saved, np.abs(saved.best[model.aam]) * run_down(seconds))
    std = np.ones(model.size)
    factor = np.eye(model.filter_size, model.filter_size + 1)
    factor[part, part], factor[part, -1] = known.factor, known.values
    posterior = posterior_of(model, factor, known.best, std)
    values = estimated_values(model, posterior)
    estimate = Estimate(
        method='online',
        valid=True,
        reason='',
        notes=(f'from a file saved {seconds:.0f} s before',),
        **{name: content[name] for name in _KEPT if name != 'unexcited'},
        unexcited=tuple(content['unexcited']),
        **{**values, 'nuisances': ()},
    )
    estimate.check()
    return Knowledge(model, known, estimate)


def _less_sure(known: Known, lost: Array) -> Known:
    """The same where the first k constants may have changed meanwhile by `lost` (k,), one std."""
    size, k = len(known.values), int(np.count_nonzero(lost))
    changed = np.flatnonzero(lost)
    rows = np.zeros((size + k, k + size + 1))
    rows[:size, :k], rows[:size, k:-1] = known.factor[:, changed], known.factor
    rows[:size, -1], rows[size:, :k] = known.values, np.diag(1.0 / lost[changed])
    left = marginal(rows, np.arange(k, k + size))
    return Known(known.part, known.best, left[:, :-1], left[:, -1])


def _fingerprint(model: MomentumModel) -> str:
    bodies = np.array2string(model.bodies.std, threshold=10_000, precision=6)
    names = [model.structure, *(g.link for g in model.robot.target_wheels), bodies]
    if not model.is_minimal:  # earlier versions told coordinates, as many, of such a robot
        names.append('inertial parameters')
    return digest('\n'.join((model.robot.urdf, *model.robot.joints, *names)))

"""What an identifier knows, in a file that survives it: checked by sum, version and robot.

Time passes between saving and loading. The inertial parameters stay; the captured wheels may have
run down at the rate that the catalogue calls plausible, by which their covariance is widened.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..estimation.filters.momentum_process import MomentumModel
from .checked_file import digest, read_checked, run_down, write_checked
from .estimate import Estimate, estimated_values
from .maximum_likelihood import Known

VERSION = 1
_KEPT = ('rank', 'condition', 'chi2_per_dof', 'samples', 'stamp_ns')


@dataclass(frozen=True, slots=True, eq=False)
class Knowledge:
    """What an identifier knows.

    Args:
        model: Whose constants they are.
        known: Of wheels and parameters; where it was saved, widened for the time that passed.
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
    robot = knowledge.known.of(slice(3, model.x.stop))
    content = {
        'best': robot.best.tolist(),
        'factor': robot.factor.tolist(),
        **{name: getattr(knowledge.estimate, name) for name in _KEPT},
    }
    write_checked(path, VERSION, _fingerprint(model), content, now_ns)


def load(path: Path, now_ns: int, model: MomentumModel) -> Knowledge:
    """Read what was known: from the file, or where it is torn or gone from the one before.

    Raises:
        RecordingError: neither can be used, and why the first can not.
    """
    return read_checked(path, VERSION, _fingerprint(model), partial(_widened, model), now_ns)


def _widened(model: MomentumModel, content: dict[str, Any], seconds: float) -> Knowledge:
    part, best = slice(3, model.x.stop), np.array(content['best'])
    inverse = np.linalg.inv(np.array(content['factor']))
    covariance = inverse @ inverse.T
    lost = np.abs(best[: model.n_aam]) * run_down(seconds)
    covariance[: model.n_aam, : model.n_aam] += np.diag(lost**2)
    factor = np.linalg.cholesky(np.linalg.inv(covariance)).T
    known = Known(part, best, factor, np.zeros(len(best)))
    constants, whole = model.prior(), np.eye(model.size)
    constants[part], whole[part, part] = best, covariance
    values = estimated_values(model, constants, whole)
    estimate = Estimate(
        method='online',
        valid=True,
        reason='',
        unexcited=(),
        notes=(f'from a file saved {seconds:.0f} s before',),
        **{name: content[name] for name in _KEPT},
        **{**values, 'nuisances': ()},
    )
    estimate.check()
    return Knowledge(model, known, estimate)


def _fingerprint(model: MomentumModel) -> str:
    return digest('\n'.join((model.robot.urdf, *model.robot.joints, *model.names)))

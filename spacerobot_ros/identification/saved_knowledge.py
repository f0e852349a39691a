"""What an identifier knows, in a file that survives it: checked by sum, version and robot.

Time passes between saving and loading. The inertial parameters stay; the captured wheels may have
run down at the rate that the catalogue calls plausible, by which their covariance is widened.
"""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..effects.catalogue import CATALOGUE
from ..errors import RecordingError
from ..estimation.momentum_process import MomentumModel
from ..model.files import write_text
from .estimate import Estimate, estimated_values
from .maximum_likelihood import Known

VERSION = 1
_RUN_DOWN = CATALOGUE['target_wheel_drag'].parameters[0].size  # 1/s, inverse of a time constant
_KEPT = ('rank', 'condition', 'chi2_per_dof', 'samples', 'stamp_ns')


@dataclass(frozen=True, slots=True, eq=False)
class Saved:
    """What was saved.

    Args:
        known: Of wheels and parameters, widened for the time that passed.
        estimate: The same to be told.
    """

    known: Known
    estimate: Estimate


def save(path: Path, model: MomentumModel, known: Known, estimate: Estimate, now_ns: int) -> None:
    """Write what is known, whole or not at all; the file before stays beside it.

    Args:
        path: The file.
        model: Whose constants they are.
        known: What is known.
        estimate: The valid estimate that goes with it.
        now_ns: Wall time [ns].

    Raises:
        ConfigurationError: it can not be written.
    """
    robot = known.of_robot()
    content = {
        'version': VERSION,
        'robot': _fingerprint(model),
        'saved_ns': now_ns,
        'best': robot.best.tolist(),
        'factor': robot.factor.tolist(),
        **{name: getattr(estimate, name) for name in _KEPT},
    }
    text = json.dumps(content)
    with suppress(FileNotFoundError):
        os.replace(path, _before(path))
    write_text(path, json.dumps({'sum': _sum(text), 'content': text}))


def load(path: Path, model: MomentumModel, now_ns: int) -> Saved:
    """Read what was known: from the file, or where it is torn or gone from the one before.

    Raises:
        RecordingError: neither can be used, and why the first can not.
    """
    try:
        return _read(path, model, now_ns)
    except RecordingError as error:
        with suppress(RecordingError):
            return _read(_before(path), model, now_ns)
        raise error


def _read(path: Path, model: MomentumModel, now_ns: int) -> Saved:
    try:
        outer = json.loads(path.read_text(encoding='utf-8'))
        text = outer['content']
        if outer['sum'] != _sum(text):
            raise RecordingError(str(path), 'its check sum is wrong: it is damaged')
        content: dict[str, Any] = json.loads(text)
        if content['version'] != VERSION:
            raise RecordingError(str(path), f'is of version {content["version"]}, not {VERSION}')
        if content['robot'] != _fingerprint(model):
            raise RecordingError(str(path), 'is of another robot, or of other parameters')
        return _widened(model, content, max(0.0, (now_ns - content['saved_ns']) * 1e-9))
    except OSError as error:
        raise RecordingError(str(path), f'can not be read: {error.strerror}') from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        if isinstance(error, RecordingError):
            raise
        raise RecordingError(str(path), f'is damaged: {error}') from error


def _widened(model: MomentumModel, content: dict[str, Any], seconds: float) -> Saved:
    part, best = slice(3, model.x.stop), np.array(content['best'])
    inverse = np.linalg.inv(np.array(content['factor']))
    covariance = inverse @ inverse.T
    lost = np.abs(best[: model.n_aam]) * -np.expm1(-_RUN_DOWN * seconds)
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
    return Saved(known, estimate)


def _before(path: Path) -> Path:
    return path.with_name(f'{path.name}.before')


def _fingerprint(model: MomentumModel) -> str:
    return _sum('\n'.join((model.robot.urdf, *model.robot.joints, *model.names)))


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()

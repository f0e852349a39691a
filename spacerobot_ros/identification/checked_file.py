"""Files of what was learned: whole or not at all, checked by sum, version and whose they are.

The file before stays beside the newest (`.before`) and is used where that is torn or gone.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from ..effects.catalogue import CATALOGUE
from ..errors import ConfigurationError, RecordingError
from ..model.files import read_text, write_text

T = TypeVar('T')

_LARGEST = 50_000_000  # bytes; 500 parameters with their covariance have a tenth of it
_RUN_DOWN = CATALOGUE['target_wheel_drag'].parameters[0].size  # 1/s, inverse of a time constant


def run_down(seconds: float) -> float:
    """Share of their momentum that captured wheels may lose in a time [s], as is plausible."""
    return -math.expm1(-_RUN_DOWN * seconds)


def digest(text: str) -> str:
    """Check sum of a text."""
    return hashlib.sha256(text.encode()).hexdigest()


def write_checked(
    path: Path, version: int, owner: str, content: Mapping[str, Any], now_ns: int
) -> None:
    """Write a file, and keep the one before.

    Args:
        path: The file.
        version: Of the content.
        owner: Digest of what it belongs to.
        content: What JSON can hold.
        now_ns: Wall time [ns].

    Raises:
        ConfigurationError: it can not be written.
    """
    head = {'version': version, 'robot': owner, 'saved_ns': now_ns}
    text = json.dumps({**head, **content})
    whole = json.dumps({'sum': digest(text), 'content': text})
    write_text(path, whole, replaced=_before(path))


def read_checked(
    path: Path, version: int, owner: str, use: Callable[[dict[str, Any], float], T], now_ns: int
) -> T:
    """Read a file, or where it can not be used the one before.

    Args:
        path: The file.
        version: Of the content.
        owner: Digest of what it must belong to.
        use: Makes something of the content and of the time since it was saved [s].
        now_ns: Wall time [ns].

    Raises:
        RecordingError: neither can be used, and why the first can not.
    """

    def read(which: Path) -> T:
        try:
            outer = json.loads(read_text(which, 'what was saved', _LARGEST))
            text = outer['content']
            if outer['sum'] != digest(text):
                raise RecordingError(str(which), 'its check sum is wrong: it is damaged')
            content: dict[str, Any] = json.loads(text)
            if content['version'] != version:
                fault = f'is of version {content["version"]}, not {version}'
                raise RecordingError(str(which), fault)
            if content['robot'] != owner:
                raise RecordingError(str(which), 'is of another robot, or of other parameters')
            return use(content, max(0.0, (now_ns - content['saved_ns']) * 1e-9))
        except RecordingError:
            raise
        except ConfigurationError as error:
            raise RecordingError(error.place, error.reason) from error
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise RecordingError(str(which), f'is damaged: {error}') from error

    try:
        return read(path)
    except RecordingError as error:
        with suppress(RecordingError):
            return read(_before(path))
        raise error


def _before(path: Path) -> Path:
    return path.with_name(f'{path.name}.before')

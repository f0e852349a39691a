"""Sentences of the pages, which stand in `assets/sentences.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources

import yaml

from ..diagnosis.answer.result import Method
from ..diagnosis.score_on import BAND


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodWords:
    """Sentences about a method, and about its figures.

    Args:
        how: All of it.
        unit: Held-out errors are in standard deviations of this.
        floor: What a noise floor is.
        signals: What measured and simulated values are; where none are, why.
        errors: Caption of all errors; empty where each kind of channel has its own.
        time: What errors are drawn against.
        nothing_left: Said where no channel stands out.
    """

    how: str
    unit: str = 'the noise'
    floor: str = 'what a right model has'
    signals: str
    errors: str = ''
    time: str = 'time [s]'
    nothing_left: str = 'Not tested: the level of what no cause explains comes from the data.'


_TEXT = (resources.files(__package__) / 'assets' / 'sentences.yaml').read_text(encoding='utf-8')
_ALL = yaml.safe_load(_TEXT.replace('{band}', f'{BAND:g}'))
WORDS: Mapping[Method, MethodWords] = {
    method: MethodWords(**words) for method, words in _ALL['methods'].items()
}
KINDS: Mapping[str, str] = _ALL['kinds']
REASONS: Mapping[str, str] = _ALL['reasons']
SAID: Mapping[str, str] = _ALL['captions']
COMPARISON, REPEATS = _ALL['comparison'], _ALL['repeats']

"""Page and plain data of the coverage campaign (`spacerobot reproduce --campaign coverage`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ..campaign.checks import Check
from ..campaign.coverage import Coverage
from ..display import Table
from ..json_values import json_value
from .reproduce_report import Page

_HEAD = [
    'axes',
    'method',
    'runs',
    'covered AAM',
    'parameters',
    'single, from',
    'to',
    'RMSE/bound AAM',
    'parameters',
    'bias/RMSE',
    'chi2/dof',
]


def to_dict(scores: Sequence[Coverage], found: Sequence[Check]) -> dict[str, Any]:
    """Plain data for JSON."""
    checks = [{**check._asdict(), 'is_met': check.is_met} for check in found]
    listed = [
        {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(score).items()}
        for score in scores
    ]
    plain: dict[str, Any] = json_value({'coverage': listed, 'checks': checks})
    return plain


def page(scores: Sequence[Coverage], found: Sequence[Check]) -> Page:
    """What the report shows."""
    table = Table(
        _HEAD,
        [_row(score) for score in scores],
        '95 % intervals; a single component of n runs scatters by 0.22/sqrt(n)',
    )
    return Page(
        title='Coverage of the stated standard deviations',
        subtitle='Seeded noisy records of the motion of Table II, wrong inertial parameters',
        headlines=[check for check in found if 'covered' in check.what],
        figures=[],
        tables=[('Coverage campaign', table)],
    )


def _row(s: Coverage) -> list[str]:
    return [
        s.axes,
        s.method,
        str(s.runs),
        f'{np.mean(s.covered[:3]):.3f}',
        f'{np.mean(s.covered[3:]):.3f}',
        f'{np.min(s.covered):.3f}',
        f'{np.max(s.covered):.3f}',
        f'{np.sqrt(np.mean(s.over_bound[:3] ** 2)):.3g}',
        f'{np.sqrt(np.mean(s.over_bound[3:] ** 2)):.3g}',
        f'{np.sqrt(np.mean(s.bias**2)):.3g}',
        f'{s.chi2_per_dof:.3f}',
    ]

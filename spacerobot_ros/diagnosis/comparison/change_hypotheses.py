"""What may have changed between two groups of recordings, as hypotheses about their rows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ...effects.prior import INSIDE
from ...estimation.balance.arm_priors import OF_LOAD, SHAPES, Machine
from ...estimation.columns import Candidate
from ...inference.hypothesis import Hypothesis
from ...types import Array, IntArray
from ..arms.arm_hypotheses import arm_hypotheses
from .run_to_run import scatter, untouched
from .two_groups import TwoGroups

_FINE = (*SHAPES, OF_LOAD, 'joint_torque_ripple')
"""Shapes of friction are not told from one motion to another well enough to have changed."""


def change_hypotheses(groups: TwoGroups) -> list[Hypothesis]:
    """Of every candidate its change, which alone may be a cause, and has its number for a key.

    And what both groups share of it, and what is of one recording.
    """
    own = scatter(groups)
    lone = 2 * groups.size + np.arange(len(groups.rows.balances) * len(own))
    sizes = np.tile(own, len(groups.rows.balances))
    of_runs = (
        _never(('own', k), np.array([at]), np.array([size]))
        for k, (at, size) in enumerate(zip(lone, sizes, strict=True))
    )
    return [*_shared(groups), *_changed(groups, own), *of_runs]


def _never(key: tuple[str, int], columns: IntArray, prior: Array) -> Hypothesis:
    """What is there, and no cause."""
    return Hypothesis(key=key, columns=columns, slab=prior, spike=prior, log_odds=-math.inf)


def _shared(groups: TwoGroups) -> Iterator[Hypothesis]:
    for i, h in enumerate(arm_hypotheses(groups.rows)):
        is_body = h.slab.ndim > 1 or h.spike.ndim > 1
        wide = h.slab if is_body else np.maximum(h.slab, h.spike)
        yield _never(('shared', i), h.columns, wide)


def _changed(groups: TwoGroups, own: Array) -> Iterator[Hypothesis]:
    rows, spikes = groups.rows, untouched(groups, own)
    machine = Machine(rows.robot, rows.balances)
    for i, (h, c) in enumerate(zip(arm_hypotheses(rows), rows.candidates, strict=True)):
        load = machine.prior_of_load(c)
        yield replace(
            h,
            columns=groups.size + h.columns,
            slab=h.slab if load is None else load.slab,
            spike=spikes[i],
            log_odds=_log_odds(groups, c, h.log_odds),
            lower=None,
            upper=None,
            body=None,
            needs=frozenset(),
        )


def _log_odds(groups: TwoGroups, candidate: Candidate, usual: float) -> float:
    if candidate.kind.id in _FINE:
        return -math.inf
    is_body = candidate.kind.id == 'inertial_parameters'
    is_inside = is_body and candidate.where not in groups.rows.robot.last_links
    return usual + INSIDE * is_inside

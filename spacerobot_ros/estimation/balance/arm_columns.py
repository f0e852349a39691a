"""Torques of an arm's candidates along its recordings, each made once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...types import Array
from ..columns import Candidate
from .balance import Balance


def columns_of(
    balances: Sequence[Balance],
    candidates: Sequence[Candidate],
    known: Mapping[Balance, Array] | None = None,
) -> list[Array]:
    """(M, n, K) of every recording [N m by coefficient].

    Args:
        balances: The model along every recording.
        candidates: Causes that may be, of K coefficients. One of other recordings adds nothing.
        known: What was made before, of the same candidates.
    """
    known = known or {}
    return [
        known[balance] if balance in known else _along(balance, run, candidates)
        for run, balance in enumerate(balances)
    ]


def _along(balance: Balance, run: int, candidates: Sequence[Candidate]) -> Array:
    steps = [step for c in candidates for step in c.small_steps]
    at = [k for k, (effect, _) in enumerate(steps) if effect.is_of(run)]
    out = np.zeros((len(balance.row_times), balance.robot.n_joints, len(steps)))
    if at:
        out[:, :, at] = balance.columns([steps[k] for k in at])
    return out

"""Rows of an arm about a model that has what was found: some columns hold for small causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ...types import Array
from ..columns import Candidate
from .arm_rows import ArmRows
from .balance import Balance


def about_model(rows: ArmRows, whole: Mapping[int, Balance], which: Iterable[int]) -> ArmRows:
    """The same rows with columns of some candidates made about other models.

    A model that lacks friction and bodies lacks their share of what goes with its torques:
    friction of the load, torques that are late, angles that are off.

    Args:
        rows: The rows.
        whole: Balances of models with what was found, by the numbers of their recordings.
        which: Numbers of the candidates.
    """
    which, columns = list(which), list(rows.columns)
    if not which:
        return rows
    at = np.concatenate([rows.places[i] for i in which])
    steps = [step for i in which for step in rows.candidates[i].small_steps]
    for run, balance in whole.items():
        columns[run] = columns[run].copy()
        columns[run][:, :, at] = balance.columns(steps)
    return rows.about_others(columns)


def about_readings(
    rows: ArmRows,
    values: Mapping[int, Array],
    undone: Sequence[Balance],
    whole: Sequence[Balance],
) -> ArmRows:
    """The same rows linearized about what is wrong with readings: delays, zeros of encoders.

    Args:
        rows: The rows.
        values: (k,) coefficients of each, by the numbers of their candidates.
        undone: Balances of the model with these undone.
        whole: The same of a model with all that was found.
    """
    about = about_model(rows, dict(enumerate(whole)), values)
    torques = [
        balance.torque + sum(full[:, :, rows.places[i]] @ own for i, own in values.items())
        for balance, full in zip(undone, about.columns, strict=True)
    ]
    return rows.about_others(about.columns, torques)


def is_of_readings(candidate: Candidate) -> bool:
    """Whether a cause changes at which angles or times torques were, in all recordings."""
    kind = candidate.kind
    is_late = kind.acts('delay') or kind.acts('joint_delays')
    return candidate.recordings is None and (is_late or kind.id == 'encoder_offset')

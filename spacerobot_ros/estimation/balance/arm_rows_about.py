"""Rows of an arm about a model that has what was found: some columns hold for small causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ...types import Array
from ..columns import Candidate
from .arm_rows import ArmRows
from .balance import Balance


def about_loads(rows: ArmRows, balances: Sequence[Balance], chosen: Iterable[int]) -> ArmRows:
    """The same rows with what follows the load by a motor's whole torque.

    A model that lacks friction and bodies lacks their share of it. Causes are chosen without:
    any friction of a joint with little to carry would pass for one that goes with its load.

    Args:
        rows: The rows.
        balances: Of a model with all that was found.
        chosen: Numbers of candidates.
    """
    own = [i for i in chosen if rows.candidates[i].kind.follows_load]
    columns = [full.copy() for full in rows.columns]
    for balance, full in zip(balances, columns, strict=True):
        for i in own:
            full[:, :, rows.places[i]] = balance.columns(rows.candidates[i].small_steps)
    return rows.about_others(columns)


def about_readings(
    rows: ArmRows,
    values: Mapping[int, Array],
    undone: Sequence[Balance],
    whole: Sequence[Balance],
) -> ArmRows:
    """The same rows linearized about what is wrong with readings: delays, zeros of encoders.

    Columns of the model hold for small ones: a model without friction lacks what friction that is
    late leaves wherever a joint turns round.

    Args:
        rows: The rows.
        values: (k,) coefficients of each, by the numbers of their candidates.
        undone: Balances of the model with these undone.
        whole: The same of a model with all that was found.
    """
    columns, torques = [full.copy() for full in rows.columns], []
    for balance, all_of_it, full in zip(undone, whole, columns, strict=True):
        torque = balance.torque.copy()
        for i, own in values.items():
            full[:, :, rows.places[i]] = all_of_it.columns(rows.candidates[i].small_steps)
            torque += full[:, :, rows.places[i]] @ own
        torques.append(torque)
    return rows.about_others(columns, torques)


def about_model(rows: ArmRows, whole: Mapping[int, Balance]) -> ArmRows:
    """The same rows with what goes with the model's torques by other models.

    Gains stay: what the scale of all torques is uncertain by is said of a change, and not found.

    Args:
        rows: The rows.
        whole: Balances of these models, by the numbers of their recordings.
    """
    some = [i for i, c in enumerate(rows.candidates) if _goes_with_torques(c)]
    columns = list(rows.columns)
    for run, balance in whole.items():
        steps = [step for i in some for step in rows.candidates[i].small_steps]
        columns[run] = columns[run].copy()
        columns[run][:, :, np.concatenate([rows.places[i] for i in some])] = balance.columns(steps)
    return rows.about_others(columns)


def is_of_readings(candidate: Candidate) -> bool:
    """Whether a cause changes at which angles or times torques were, in all recordings."""
    kind = candidate.kind
    is_late = kind.acts('delay') or kind.acts('joint_delays')
    return candidate.recordings is None and (is_late or kind.id == 'encoder_offset')


def _goes_with_torques(candidate: Candidate) -> bool:
    return is_of_readings(candidate) or candidate.kind.follows_load

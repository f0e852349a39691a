"""What a machine that nobody touched differs by from one recording to the next."""

from __future__ import annotations

import numpy as np

from ...effects.prior import BY_DIRECTION, NOTHING, RUN_TO_RUN, UNTOUCHED
from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_priors import DRY
from ...inference.gram import sum_of
from ...inference.marginal import Marginal
from ...types import Array
from .two_groups import LAWS, TwoGroups


def scatter(groups: TwoGroups) -> Array:
    """(m,) standard deviations of what is of one recording, see `TwoGroups.own`.

    A share of the friction that is there, and what the recordings before show of it: the guess
    counts as one of them.
    """
    usual, rows, (first, _) = _usual(groups), groups.rows, groups.groups
    m, runs = len(usual), groups.count
    if runs < 2 or not m:
        return usual
    places = [groups.places(run)[: 2 * groups.size + runs * m] for run in range(runs)]
    grams = zip(first.parts(groups.levels[0]), first.recording, strict=True)
    whole = sum_of([gram.placed(places[int(run)]) for gram, run in grams])
    sizes = rows.sizes[groups.own]
    shared = np.maximum(rows.sizes, rows.tolerances)
    variances = np.concatenate([shared, np.zeros(groups.size), *[sizes] * runs]) ** 2
    own = np.arange(2 * groups.size, len(variances))
    found = Marginal.of(whole, np.arange(len(variances)), variances)
    values = found.mean(own, variances[own]).reshape(runs, m)
    covariance = found.covariance(own, variances[own]).reshape(runs, m, runs, m)
    noise = np.einsum('rmrm->m', covariance) - np.einsum('rmsm->m', covariance) / runs
    seen = np.sum((values - np.mean(values, axis=0)) ** 2, axis=0) - noise
    return np.sqrt((usual**2 + np.maximum(seen, 0.0)) / runs)


def untouched(groups: TwoGroups, own: Array) -> list[Array]:
    """Prior of every candidate's change where it is none.

    Args:
        groups: The recordings.
        own: (m,) `scatter`: a group differs from the other by as much as its recordings.
    """
    rows, out = groups.rows, list[Array]()
    for i, (c, at) in enumerate(zip(rows.candidates, rows.places, strict=True)):
        if c.where in rows.robot.last_links:  # a payload does not change by itself
            out.append(np.zeros(len(at)))
        elif c.kind.id in (DRY, *ZEROS):
            out.append(own[np.searchsorted(np.sort(groups.own), at)])
        elif c.kind.id in LAWS:
            out.append(RUN_TO_RUN * _rubbing(groups, i))
        elif c.prior is not None and c.prior.slab.ndim > 1:
            out.append(UNTOUCHED**2 * c.prior.slab)
        else:
            out.append(UNTOUCHED * c.sizes)
    return out


def _usual(groups: TwoGroups) -> Array:
    """(m,) shares of friction."""
    shares = {DRY: RUN_TO_RUN, **dict.fromkeys(ZEROS, BY_DIRECTION)}
    return np.concatenate(
        [
            np.maximum(shares[c.kind.id] * _rubbing(groups, i), NOTHING * c.sizes)
            for i, c in enumerate(groups.rows.candidates)
            if c.kind.id in shares
        ]
        or [np.zeros(0)]
    )


def _rubbing(groups: TwoGroups, i: int) -> Array:
    """(k,) coefficients of a candidate at a joint whose torque is that of its friction."""
    rows, c = groups.rows, groups.rows.candidates[i]
    j = rows.robot.joints.index(str(c.where))
    columns = rows.joints[j].columns[:, rows.places[i]]
    if not len(columns):
        return np.zeros(len(c.sizes))
    power = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), np.finfo(float).tiny)
    return np.minimum(groups.friction[j] / power, c.sizes)

"""From which size on a change would have been named in these very recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...estimation.inference.evidence import Gram, log_evidence
from ...types import Array
from ..old.held_out_checks import holds
from ..old.selection import Selection

_STEP, _STEPS = 1.25, 12  # up to 14 times the least size


def named_from(selection: Selection, i: int, least: Array, unexplained: float) -> float:
    """Size of a change along one parameter from which it holds, whichever sign it has.

    What every part of the second group must say of a change, beside what it misses anyway, is no
    multiple of what the rows can tell. A change of x adds S x to the sums for its coefficients, S
    their information, in the whole and in all parts but one; so each size is tried.

    Args:
        selection: In which nothing is chosen.
        i: The change.
        least: (K,) of its coefficients, along one of them: what the rows can tell.
        unexplained: Squares of whitened rows of which it must explain half.

    Returns:
        The size; infinite where none is named.
    """
    own, need = selection.rows.places[i], selection.need(i)
    rests = [selection.posterior((), fold.rest).group(own) for fold in selection.parts.folds(i)]
    grams = [selection.posterior(()).group(own), *rests]
    for size in np.linalg.norm(least) * _STEP ** np.arange(_STEPS):
        change = size * least / np.linalg.norm(least)
        if all(_is_named(selection, i, grams, x, need, unexplained) for x in (change, -change)):
            return float(size)
    return np.inf


def _is_named(
    selection: Selection, i: int, grams: list[Gram], change: Array, need: float, unexplained: float
) -> bool:
    candidate = selection.rows.candidates[i]
    added = [replace(g, vector=g.vector + g.matrix @ change) for g in grams]
    bounds = candidate.lower, candidate.upper
    whole, *rests = (log_evidence(g, candidate.sizes, bounds) for g in added)
    usual = log_evidence(added[0], selection.rows.tolerances[selection.rows.places[i]], bounds)
    gains = whole - np.array(rests)
    return bool(whole - usual > need and holds(gains) and 2.0 * np.sum(gains) > unexplained)

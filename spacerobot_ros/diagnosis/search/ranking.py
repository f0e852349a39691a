"""Which candidates are worth a fit: best first, significant, as good as the best, or alike."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ...effects.effect import Key
from ...estimation.fit import Fit
from ..limits import (
    ALIKE_SHARE,
    CLOSE_GAP,
    CLOSE_SHARE,
    EQUIVALENT,
    FALSE_ALARMS,
    FREEDOM,
    MOST_ALIKE,
    SHORTLIST,
)
from .pool import Judged


def ranked(judged: Iterable[Judged]) -> list[Judged]:
    """Best evidence first; of each effect at each place only one variant."""
    variants: dict[Key, list[Judged]] = {}
    for j in sorted(judged, key=lambda j: -j.score.evidence):
        variants.setdefault(j.candidate.key, []).append(j)
    return sorted(
        (_first_guess(own) for own in variants.values()), key=lambda j: -j.score.evidence
    )


def _first_guess(variants: Sequence[Judged]) -> Judged:
    """The best; of frequencies that columns do not tell apart, that of the smallest effect.

    A stiff spring does what a softer one of a lesser body does, as long as its body is small: for
    others columns do not hold.
    """
    best = variants[0]
    if not best.candidate.kind.hidden:
        return best
    alike = [j for j in variants if j.score.evidence > best.score.evidence - EQUIVALENT]
    return min(alike, key=lambda j: float(np.linalg.norm(j.score.estimate / j.candidate.sizes)))


def wanted_of(ranking: Sequence[Judged]) -> list[Judged]:
    """Candidates that are significant among all, worth their parameters, and held up."""
    count = sum(j.candidate.trials for j in ranking)
    return [
        j
        for j in ranking
        if j.score.evidence > 0.0
        and j.score.bic_gain > 0.0
        and j.score.p_value * count < FALSE_ALARMS
        and j.score.held_out > 0.0
    ]


def shortlist(wanted: Sequence[Judged]) -> list[Judged]:
    """The best and those nearly as good, each kind of effect at its best place."""
    floor = close_to(wanted[0])
    kinds = {j.candidate.kind.id: j for j in reversed(wanted)}
    close = sorted(kinds.values(), key=lambda j: -j.score.evidence)[:SHORTLIST]
    return [j for j in close if j.score.evidence >= floor]


def close_to(best: Judged) -> float:
    """Evidence on columns from which fits may tell others from the best."""
    evidence = best.score.evidence
    return min(CLOSE_SHARE * evidence, evidence - CLOSE_GAP)


def elsewhere(best: Judged, wanted: Sequence[Judged]) -> list[Judged]:
    """The same effect at other places that do half as well: neighbours share its columns.

    What swings is looked at everywhere: its columns are those of first guesses, and a panel is
    seldom one of them.
    """
    floor = ALIKE_SHARE * best.score.evidence
    same = [j for j in wanted if j.candidate.kind is best.candidate.kind and j is not best]
    if best.candidate.kind.hidden:
        return same
    return [j for j in same if j.score.evidence >= floor][:MOST_ALIKE]


def may_rival(fit: Fit, top: float) -> bool:
    """Whether better values may make a fit a rival of log evidence `top`.

    By twice what its tangents promise: guesses from columns are wrong by less.
    """
    if not np.isfinite(fit.evidence):
        return True
    return fit.evidence + fit.promised > top - FREEDOM * EQUIVALENT


def is_rival(other: Fit, top: Fit) -> bool:
    """Whether a fit can not be told from the best, or is as good by more freedom."""
    gap, more = top.evidence - other.evidence, other.misfit - top.misfit
    return gap < EQUIVALENT or (gap < FREEDOM * EQUIVALENT and more < EQUIVALENT)

"""An arm's candidates as hypotheses about its rows, numbered alike, and these rows in blocks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.effect import Effect
from ...effects.prior import Prior
from ...estimation.balance.arm_candidates import GAIN
from ...estimation.balance.arm_priors import DRY, OF_LOAD, SHAPES, VISCOUS, is_kind_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.columns import Candidate
from ...estimation.inference.constrained import NEXT_TO_NOTHING, PhysicalBody
from ...inference.decisive import IMPLAUSIBLE
from ...inference.gram_blocks import NEVER_HELD_OUT, GramBlocks
from ...inference.hypothesis import Hypothesis
from ...types import Array

_AFTER_FRICTION = (*SHAPES, OF_LOAD)
"""Laws that are finer than a straight one: asked beside dry or viscous friction of their joint."""


def arm_hypotheses(rows: ArmRows) -> list[Hypothesis]:
    """Every candidate of some rows, its number its key."""
    return [_hypothesis(rows, i, c) for i, c in enumerate(rows.candidates)]


def _hypothesis(rows: ArmRows, i: int, candidate: Candidate) -> Hypothesis:
    own, every = rows.places[i], list(enumerate(rows.candidates))
    prior = candidate.prior or Prior(rows.sizes[own], np.zeros(len(own)))
    here = [(k, c) for k, c in every if c is not candidate and _is_beside(c, candidate)]
    others = (k for k, c in here if _contradict(c.kind, candidate.kind))
    return Hypothesis(
        key=i,
        columns=own,
        slab=prior.slab,
        spike=prior.spike,
        log_odds=prior.log_odds,
        lower=candidate.lower,
        upper=_upper(candidate, prior),
        body=_body(rows, candidate),
        family=(candidate.key, candidate.recordings),
        needs=_needs(rows, candidate, here),
        excludes=frozenset(others),
    )


def _upper(candidate: Candidate, prior: Prior) -> Array:
    """(k,) bounds; of a gain, those of what is plausible.

    Its column is the measured torque itself, 1 - 1 / g of which is missed: as g grows, that is any
    torque that does not follow from the model at all.
    """
    return IMPLAUSIBLE * prior.sizes if candidate.kind.id == GAIN else candidate.upper


def _is_beside(one: Candidate, other: Candidate) -> bool:
    return (one.where, one.recordings) == (other.where, other.recordings)


def _contradict(one: type[Effect], other: type[Effect]) -> bool:
    return one.id in other.excludes or other.id in one.excludes or _contains(one, other)


def _contains(one: type[Effect], other: type[Effect]) -> bool:
    """Whether one of two laws is dry friction, and the other it and more."""
    pairs = ((one, other), (other, one))
    return any(a.id == DRY and DRY in b.refines and not b.hidden for a, b in pairs)


def _needs(
    rows: ArmRows, candidate: Candidate, here: Sequence[tuple[int, Candidate]]
) -> frozenset[int]:
    """Plain frictions of the joint, beside one of which a finer law without its own is asked."""
    if candidate.kind.id not in _AFTER_FRICTION or _is_friction(candidate.kind):
        return frozenset()
    believed = rows.balances[0].effects
    if any(e.where == candidate.where and _is_friction(type(e)) for e in believed):
        return frozenset()
    return frozenset(k for k, c in here if _is_friction(c.kind))


def _is_friction(kind: type[Effect]) -> bool:
    return is_kind_of(kind, DRY) or is_kind_of(kind, VISCOUS)


def _body(rows: ArmRows, candidate: Candidate) -> PhysicalBody | None:
    """What its ten numbers have to be added to: the file's body, or nothing for a load."""
    if candidate.kind.id != 'inertial_parameters':
        return None
    names = [body.name for body in rows.robot.bodies]
    file = rows.robot.inertial_parameters[names.index(str(candidate.where))]
    body = PhysicalBody(np.arange(10), NEXT_TO_NOTHING if candidate.recordings else file)
    return body if body.is_body else None


def blocks_of(rows: ArmRows, levels: Sequence[Array]) -> GramBlocks:
    """The rows in clusters, whitened.

    Args:
        rows: The rows.
        levels: (8,) variances of what is left of every set of `ArmRows.joints`.
    """
    out = no_blocks(rows)
    add_blocks(out, rows.in_clusters, levels)
    return out


def no_blocks(rows: ArmRows) -> GramBlocks:
    """No rows but those that hold the scale of what nothing measured tells."""
    out = GramBlocks(len(rows.tolerances))
    out.add_sums(rows.held, NEVER_HELD_OUT)
    return out


def add_blocks(blocks: GramBlocks, clusters: ArmRows, levels: Sequence[Array]) -> None:
    """Add every cluster of some rows, whitened."""
    for gram, recording in zip(clusters.parts(levels), clusters.recording.tolist(), strict=True):
        blocks.add_sums(gram, recording)

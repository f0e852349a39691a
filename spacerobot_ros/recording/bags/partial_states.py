"""Joint states in parts, as several publishers send them: one an arm, one a gripper.

The part with most messages gives the times; what others say is interpolated to them, and is theirs
where stamps agree. Nothing is said where another part pauses, has begun later or ended before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...types import Array, IntArray

JointPart = tuple[Array, Array]
"""(M,) stamps [ns] and (M, 3, n) rows of messages with the same joints; NaN for all others."""
_PAUSE = 4.0  # usual periods of a part that a hole in it may have


def merged(parts: Mapping[tuple[int, ...], JointPart]) -> tuple[IntArray, Array] | None:
    """(N,) stamps [ns] and (N, 3, n) rows of all joints.

    Args:
        parts: By the joints that they have, as columns.

    Returns:
        None where the parts lack a joint, or have no time in common.
    """
    columns = sorted({column for own in parts for column in own})
    if not parts or columns != list(range(next(iter(parts.values()))[1].shape[2])):
        return None
    ordered = sorted(parts.items(), key=lambda part: -len(part[1][0]))
    (_, (stamps, rows)), *others = ordered
    stamps, first = np.unique(stamps, return_index=True)
    whole, is_known = rows[first].copy(), np.ones(len(stamps), dtype=bool)
    for own, part in others:
        filled, known = _at(stamps, part, own)
        empty = [k for k in own if np.isnan(whole[:, 0, k]).all()]
        whole[:, :, empty] = filled[:, :, empty]
        is_known &= known
    return (stamps[is_known].astype(np.int64), whole[is_known]) if is_known.any() else None


def _at(stamps: Array, part: JointPart, columns: Sequence[int]) -> tuple[Array, Array]:
    """(N, 3, n) rows of a part at some stamps, and (N,) whether it says anything there."""
    own, first = np.unique(part[0], return_index=True)
    rows = part[1][first]
    out = np.full((len(stamps), *rows.shape[1:]), np.nan)
    for k in columns:
        for i in range(rows.shape[1]):
            out[:, i, k] = np.interp(stamps - own[0], own - own[0], rows[:, i, k])
    after = np.searchsorted(own, stamps)
    inside = (after < len(own)) & ((after > 0) | (stamps == own[0]))
    near = np.clip(after, 1, max(len(own) - 1, 1))
    if len(own) < 2:
        return out, stamps == own[0]
    gap = own[near] - own[near - 1]
    return out, inside & ((gap <= _PAUSE * np.median(np.diff(own))) | np.isin(stamps, own))

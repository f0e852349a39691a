"""Why causes that leave nothing may stand for an effect that is in no catalogue.

Such an effect acts in other proportions at other times, and the best that a catalogue has for it
is a sum: of causes that undo each other, or of one that takes most and one that takes the rest.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...estimation.fit import Fit
from ...estimation.inference.evidence import LEAST_PRECISION, explained
from ...estimation.scaling import size_of
from ...inference.decisive import IMPLAUSIBLE
from ...inference.gram import Gram
from ...types import Array
from ..answer.words import at
from ..limits import CANCELLED, EXACT, IMITATED, LITTLE, WRONG_ANSWERS

_DRIFTS = 2  # cosines of the record's length: what changes faster is left to the test of fit
_STANDS = 'something that is not in the catalogue may be what they stand for'


def doubts(fit: Fit, slabs: list[float]) -> Iterator[str]:
    """What speaks against the names of causes that leave nothing.

    Args:
        fit: The causes.
        slabs: By cause, its largest value in units of what is plausible.
    """
    for cause, size in zip(fit.causes, slabs, strict=True):
        if size > IMPLAUSIBLE:
            what = f'{cause.title}{at(cause.where)}'
            yield f'but {what} is {size:.2g} times as large as is plausible: {_STANDS}'
    if cancellation(fit) > CANCELLED:
        yield f'but these undo most of what each of them does: {_STANDS}'
    if (least := least_needed(fit)) is not None:
        cause = fit.causes[least]
        what = f'{cause.title}{at(cause.where)}'
        yield f'but {what} is weakly supported, the other causes explain nearly all: {_STANDS}'
    if 2.0 * drift_p(fit) < WRONG_ANSWERS:
        yield f'but the values drift along the record, if only together: {_STANDS}'


def cancellation(fit: Fit) -> float:
    """Squares of what causes change each, by the square of what they change together.

    Known inputs that are wrong count as one: thrusters are mounted against each other, and what
    each does follows its own command.
    """
    shares = [fit.share(i) for i in range(len(fit.causes))]
    is_input = [cause.group == 'inputs' for cause in fit.causes]
    each = [share for share, own in zip(shares, is_input, strict=True) if not own]
    if any(is_input):
        each.append(np.sum([x for x, own in zip(shares, is_input, strict=True) if own], axis=0))
    apart, together = sum(_squares(fit, x) for x in each), _squares(fit, np.sum(each, axis=0))
    return apart / together if together else 1.0


def _squares(fit: Fit, share: Array) -> float:
    """Of what coordinates (P,) change."""
    return float(share @ fit.gram.matrix @ share)


def least_needed(fit: Fit) -> int | None:
    """The cause that adds so little to all others that it may be what a wrong name leaves.

    Its extra sum of squares beside the others' columns is small, in itself and by the mean share
    of what all do. What is next to nothing is no such leftover: no two effects are that alike.
    """
    count = len(fit.causes)
    if count < 2:
        return None
    extra, whole = [_extra_squares(fit, i) for i in range(count)], _whole(fit)
    least = int(np.argmin(extra))
    little = min(LITTLE * whole / count, IMITATED)
    return least if EXACT**2 * whole <= extra[least] < little else None


def _extra_squares(fit: Fit, index: int) -> float:
    """What a cause changes beyond what the values of all others could."""
    others, matrix = np.setdiff1d(np.arange(len(fit.free)), fit.own(index)), fit.gram.matrix
    changed = matrix @ fit.share(index)
    square = float(changed @ fit.share(index))
    gram = Gram(matrix[np.ix_(others, others)], changed[others], square, fit.gram.rows)
    return gram.without(len(others), fit.precision[others] + LEAST_PRECISION).square


def drift_p(fit: Fit) -> float:
    """Probability that the values of all causes together drift so along the record.

    Each cause's columns times cosines of the record's length, beside the columns as they are. A
    drift of less than `EXACT` of what the causes do together is none: no model is that right.
    """
    if not fit.free:
        return 1.0
    gram = fit.drifting(_DRIFTS + 1)
    alone = gram.without(len(fit.free), fit.precision + LEAST_PRECISION)
    gain, p_value = explained(alone, np.tile(_sizes(fit), _DRIFTS))
    return p_value if gain > EXACT**2 * _whole(fit) else 1.0


def _whole(fit: Fit) -> float:
    """Square of what all causes change together."""
    return _squares(fit, np.sum([fit.share(i) for i in range(len(fit.causes))], axis=0))


def _sizes(fit: Fit) -> Array:
    return np.array([size_of(p) for _, p in fit.free])

"""What is put on a last link, or taken off it, is a body.

Ten numbers that motions hardly tell apart are not solved for as if anything could be added: on a
small arm an unbounded solve says that -0.03 kg with a first moment of 0.13 kg m were put on, which
no body has, and the likeliest body, 0.47 kg where 0.48 are known, has next to as much evidence. A
tool in place of another one is no body, nor less one: what is there then is one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...estimation.inference.constrained import NEXT_TO_NOTHING, ConstrainedProblem, PhysicalBody
from ...estimation.inference.evidence import Gram, chi_square_tail
from ...types import Array
from ..limits import MISFIT

_NUMBERS = 10
_DRAWS = 40  # of which a standard deviation is known to 11 %


@dataclass(frozen=True, slots=True, eq=False)
class PutOn:
    """The likeliest body.

    Args:
        values: (10,) of the change, all signs turned where it was taken off.
        spread: (10,) standard deviations.
        lost: Log posterior density less than that of the likeliest numbers of all.
    """

    values: Array
    spread: Array
    lost: float


def put_on(gram: Gram, sizes: Array, unexplained: float = 0.0) -> PutOn | None:
    """The likeliest body that was put on or taken off; None where it was none.

    It is none where the data say so beyond chance, and beyond what no change explains of them.

    Args:
        gram: Sums for the ten numbers of `toDynamicParameters`, all else integrated out.
        sizes: (10,) their plausible sizes.
        unexplained: Squares of whitened rows that no change explains.
    """
    signs = (1.0, -1.0)
    solved = [_solved(gram, sizes, NEXT_TO_NOTHING, sign) for sign in signs]
    sign, (values, square) = min(zip(signs, solved, strict=True), key=lambda pair: pair[1][1])
    if square > unexplained and chi_square_tail(square, _NUMBERS) < MISFIT:
        return None
    return _with_spread(gram, sizes, NEXT_TO_NOTHING, sign, values, square)


def exchanged(gram: Gram, sizes: Array, file: Array, shared: Array) -> PutOn:
    """The likeliest change of a body that leaves one.

    Args:
        gram: Sums for the ten numbers of `toDynamicParameters`, all else integrated out.
        sizes: (10,) their plausible sizes.
        file: (10,) of the body in the file.
        shared: (10,) of what both groups have beyond it, which counts where that is a body.
    """
    before = PhysicalBody(np.arange(_NUMBERS), file + shared)
    base = before.file if before.is_body else file
    return _with_spread(gram, sizes, base, 1.0, *_solved(gram, sizes, base, 1.0))


def _solved(gram: Gram, sizes: Array, base: Array, sign: float) -> tuple[Array, float]:
    """(10,) the likeliest change by which `base` is a body, and what it costs in chi-square."""
    information = gram.matrix + np.diag(sizes**-2.0)
    values = sign * _body(information, sign * gram.vector, sizes, base)
    off = values - np.linalg.solve(information, gram.vector)
    return values, float(off @ information @ off)


def _with_spread(
    gram: Gram, sizes: Array, base: Array, sign: float, values: Array, square: float
) -> PutOn:
    """The change with its deviations.

    These are those of the estimate itself, bodies included, over draws of the data about it
    (Efron and Tibshirani, An Introduction to the Bootstrap (1993), 6.5), times what it is farther
    from the likeliest numbers of all than chance has it.
    """
    information = gram.matrix + np.diag(sizes**-2.0)
    root = np.linalg.cholesky(information)
    noise = np.random.default_rng(0).normal(size=(_DRAWS, _NUMBERS)) @ root.T
    draws = [_body(information, sign * (information @ values + n), sizes, base) for n in noise]
    wider = max(1.0, square / _NUMBERS) ** 0.5
    spread = wider * np.sqrt(np.mean((np.array(draws) - sign * values) ** 2, axis=0))
    return PutOn(values, spread, 0.5 * square)


def _body(information: Array, vector: Array, sizes: Array, base: Array) -> Array:
    """(10,) that make a body of another one."""
    none = np.full(_NUMBERS, np.inf)
    body = PhysicalBody(np.arange(_NUMBERS), base)
    return ConstrainedProblem(information, vector, sizes, -none, none, (body,)).solve()

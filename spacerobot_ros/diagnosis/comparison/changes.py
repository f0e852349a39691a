"""What a comparison of recordings says, whichever way it was made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...estimation.balance.arm_fit import ArmFit
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.columns import Candidate
from ...estimation.inference.constrained import NEXT_TO_NOTHING, ConstrainedProblem, PhysicalBody
from ...estimation.inference.evidence import Gram, chi_square_tail
from ...model.robot import Robot
from ...types import Array
from ..arms.arm_found import is_clear
from ..arms.selection import Selection
from ..limits import MISFIT
from .moments import Moments

_FINE = (
    'joint_stribeck_friction',
    'joint_friction_curvature',
    'joint_presliding_friction',
    'joint_coupled_friction',
    'joint_torque_ripple',
)


@dataclass(frozen=True, eq=False)
class Changes:
    """What a comparison says.

    Args:
        robot: The robot file's robot.
        selection: The choice among changes.
        fit: The chosen ones with values.
        levels: (n, 8) variances of every joint's leftover [N^2 m^2].
        after: Number, among those of the fit, of the first recording of the second group.
        moments: By which a change is less certain than its rows say; None: no more is known.
        unexplained: Squares of whitened rows of which a change must explain half [-].
        is_repeated: Whether all recordings are of one motion, what is usual from run to run known.
    """

    robot: Robot
    selection: Selection
    fit: ArmFit
    levels: Array
    after: int
    moments: Moments | None = None
    unexplained: float = 0.0
    is_repeated: bool = False

    @cached_property
    def bodies(self) -> dict[int, PutOn]:
        """What was put on links, taken off or exchanged, by the number of the change."""
        rows = self.fit.rows
        named = (i for i in self.fit.chosen if rows.candidates[i].kind.id == 'inertial_parameters')
        return {i: self._body(i) for i in named}

    def _body(self, i: int) -> PutOn:
        rows, own, posterior = self.fit.rows, self.fit.rows.places[i], self.fit.posterior
        gram, sizes = posterior.group(own), rows.sizes[own]
        body = put_on(gram, sizes, self.unexplained)
        if body is not None:
            return body
        names = [body.name for body in rows.robot.bodies]
        file = rows.robot.inertial_parameters[names.index(str(rows.candidates[i].where))]
        twice = len(posterior.mean) - sum(len(c.sizes) for c in rows.candidates)
        shared = posterior.mean[own - twice] if twice else np.zeros(len(own))
        return exchanged(gram, sizes, file, shared)

    def change(self, i: int) -> tuple[Array, Array]:
        """(k,) values and standard deviations of a chosen change, by rows and moments."""
        own = self.fit.rows.places[i]
        wider = self.moments.judge(i).wider if self.moments else 1.0
        if i in self.bodies:
            return self.bodies[i].values, wider * self.bodies[i].spread
        posterior = self.fit.posterior
        return posterior.mean[own], wider * np.sqrt(np.diag(posterior.covariance)[own])


def is_lasting(candidate: Candidate) -> bool:
    """Whether a change may be named: of a finer shape of friction it may not."""
    return candidate.kind.id not in _FINE


def clear_fit(selection: Selection, wider: Callable[[int], float] = lambda i: 1.0) -> ArmFit:
    """The choice with values; changes that are not clear of them go, weakest first.

    Args:
        selection: The choice.
        wider: Times by which a change is less certain than its rows say.
    """
    while True:
        fit = ArmFit(selection.rows, selection.whole, tuple(selection.chosen))
        unclear = [i for i in fit.chosen if not is_clear(fit, i, wider(i))]
        if not unclear:
            return fit
        selection.drop(min(unclear, key=selection.gain))


class ChangeRows(ArmRows):
    """Rows among whose candidates only changes that last are named."""

    def may_be_chosen(self, i: int) -> bool:
        """See `is_lasting`."""
        return is_lasting(self.candidates[i])

    @property
    def holds_tolerances(self) -> bool:
        """Two motions differ in what a wrong file leaves of them, too: no tolerance knows it.

        Held at their tolerances the runs of a KUKA, slow and fast, had changes of 0.5 kg.
        """
        return False


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

    Ten numbers that motions hardly tell apart are not solved for as if anything could be added: on
    a small arm an unbounded solve says that -0.03 kg with a first moment of 0.13 kg m were put on,
    which no body has, and the likeliest body, 0.47 kg where 0.48 are known, has next to as much
    evidence. A tool in place of another one is no body, nor less one: what is there then is one.

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

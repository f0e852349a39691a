"""What a comparison of recordings says, whichever way it was made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...estimation.balance.arm_fit import ArmFit
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.columns import Candidate
from ...model.robot import Robot
from ...types import Array
from ..limits import CHANCE
from ..old.selection import Selection
from .moments import Moments
from .put_on import PutOn, exchanged, put_on

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
        unclear = [i for i in fit.chosen if fit.chance(i, wider(i)) >= CHANCE]
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

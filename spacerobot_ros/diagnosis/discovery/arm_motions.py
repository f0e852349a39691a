"""Inputs of laws along the recordings of an arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...effects.laws.grammar import input_of
from ...estimation.balance.arm_priors import DRY, friction_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance
from ...types import Array
from .possible_laws import Extent, Law, joint_laws, time_sines

_ONE_SPEED = 0.2
"""Of its middle speed: a joint whose speeds spread less moves at one speed, where friction that
grows with the rate is friction that does not."""


@dataclass(frozen=True, eq=False)
class ArmMotions:
    """Recordings of an arm.

    Args:
        rows: The recordings.
        balances: The model with all that was found along each of them: a model that lacks friction
            and bodies lacks their share of a motor's torque, with which a law may go.
    """

    rows: ArmRows
    balances: Sequence[Balance]

    @cached_property
    def extent(self) -> Extent:
        """What all recordings cover together."""
        motions = [b.motion for b in self.rows.balances]
        q, qd = (np.concatenate(x) for x in zip(*((m.q, m.qd) for m in motions), strict=True))
        duration = max(float(np.ptp(m.time)) for m in motions)
        return Extent.of(self.rows.robot.joints, q, qd, duration)

    @cached_property
    def friction(self) -> Array:
        """(n,) Coulomb friction of the model with all that was found [N m]."""
        effects = self.balances[0].effects
        return np.abs([friction_of(effects, DRY, joint) for joint in self.rows.robot.joints])

    def laws(self, j: int) -> list[Law]:
        """That joint j may have; sines of the time, of one recording alone, among them."""
        robot, balances = self.rows.robot, self.rows.balances
        extras = [
            n for n in balances[0].motion.extra if all(n in b.motion.extra for b in balances)
        ]
        laws = joint_laws(robot.joints[j], robot.ways(robot.joints), extras, self.extent)
        if len(balances) == 1:  # each has a clock of its own
            laws += time_sines(max(float(np.ptp(self.rows.joint_times(j))), 1e-9))
        return laws

    def values(self, law: Law, run: int) -> Array:
        """(N, k) functions of a law along a recording."""
        motion = self.balances[run].motion
        inputs = [np.asarray(input_of(name, motion)) for name in law.inputs]
        return np.asarray(law.form(inputs, law.options))

    def torques(self, laws: Sequence[Law], j: int) -> Array:
        """(R, c) rows of joint j by the coefficients of some laws.

        What depends on the time alone is slow, and passes the filters unchanged.
        """
        times = self.rows.joint_times(j)
        others = [law for law in laws if law.inputs != ('time',)]
        ends = np.cumsum([len(law.form.powers) for law in others])[:-1]
        own = iter(np.split(self._filtered(others, j), ends, axis=1) if others else ())
        every = (
            law.form([times], law.options) if law.inputs == ('time',) else next(own)
            for law in laws
        )
        return np.concatenate([np.zeros((len(times), 0)), *every], axis=1)

    def _filtered(self, laws: Sequence[Law], j: int) -> Array:
        """(R, c) the same of what passes the filters; terms of many laws once."""
        rows = []
        for run, balance in enumerate(self.rows.balances):
            values = np.concatenate([self.values(law, run) for law in laws], axis=1)
            first: dict[bytes, int] = {}
            which = [first.setdefault(term.tobytes(), len(first)) for term in values.T]
            own = values[:, np.unique(which, return_index=True)[1]]
            out = balance.in_rows(own, np.full(len(first), j))
            rows.append(out[self.rows.rows_at(balance, j)][:, which])
        return np.concatenate(rows)

    def ranges(self, law: Law, j: int) -> Mapping[str, tuple[float, float]]:
        """Smallest and largest of every input where joint j moves."""
        out = {}
        for name in law.inputs:
            every = np.concatenate(
                [
                    np.asarray(input_of(name, own.motion))[b.arm.is_moving[:, j]]
                    for own, b in zip(self.balances, self.rows.balances, strict=True)
                ]
            )
            out[name] = float(np.min(every)), float(np.max(every))
        return out

    def loudness(self, j: int, loud: float) -> Array:
        """(R,) sizes of the noise of the rows of joint j, of which the geometric mean is 1.

        Args:
            j: Number of the joint.
            loud: Share of what is left whose square grows with that of the rate.
        """
        balances = self.rows.balances
        rate = np.concatenate(
            [b.motion.qd[:: b.arm.stride, j][self.rows.rows_at(b, j)] for b in balances]
        )
        square = 1.0 - loud + loud * rate**2 / np.mean(rate**2)
        return np.asarray(np.exp(0.5 * (np.log(square) - np.mean(np.log(square)))))

    def has_one_speed(self, j: int) -> bool:
        """Whether joint j moves at one speed, so that forms of friction are one there."""
        rates = [b.motion.qd[b.arm.is_moving[:, j], j] for b in self.rows.balances]
        low, middle, high = np.quantile(np.abs(np.concatenate(rates)), [0.05, 0.5, 0.95])
        return bool(high - low < _ONE_SPEED * middle)

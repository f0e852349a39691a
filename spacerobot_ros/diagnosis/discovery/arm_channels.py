"""Channels of an arm: what is left of each joint's torque, and what laws would make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.laws.grammar import input_of
from ...estimation.balance.arm_levels import leftover_level
from ...estimation.balance.arm_priors import COUPLED, DRY, friction_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance
from ...estimation.balance.leftover import JointRows, KalmanGains
from ...estimation.inference.spectral_terms import SpectralTerms, cosines
from ...estimation.rows import BLOCKS
from ...types import Array, IntArray
from .discovery_limits import ONE_SPEED
from .possible_laws import Extent, Law, joint_laws, time_sines

_SHAPES = ('joint_stribeck_friction', 'joint_friction_curvature')
REPLACEABLE = ('joint_stiffness', 'joint_torque_ripple', COUPLED)
"""Causes that are a form of the grammar, so that a law may stand in their place. No other
friction: on a UR10e laws would take the place of a shape that has a name, and say no more."""
_LOUD = (0.0, 0.5, 0.9)
"""Of noise that grows with the rate. Likelihood tells them apart: of noise that does it is 50 to
180 nats more at 0.9 than at 0, of noise that does not 50 to 170 less (30 machines of all noises,
with laws and without)."""


@dataclass(frozen=True, eq=False)
class ArmMotions:
    """Inputs of laws along all recordings of an arm.

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

    def inputs(self, law: Law, run: int) -> list[Array]:
        """(N,) inputs of a law along a recording."""
        motion = self.balances[run].motion
        return [np.asarray(input_of(name, motion)) for name in law.inputs]

    def ranges(self, law: Law, j: int) -> Mapping[str, tuple[float, float]]:
        """Smallest and largest of every input where joint j moves."""
        out = {}
        for k, name in enumerate(law.inputs):
            ends = [
                self.inputs(law, run)[k][b.arm.is_moving[:, j]]
                for run, b in enumerate(self.rows.balances)
            ]
            every = np.concatenate(ends)
            out[name] = float(np.min(every)), float(np.max(every))
        return out

    def has_one_speed(self, j: int) -> bool:
        """Whether joint j moves at one speed, so that forms of friction are one there."""
        rates = [b.motion.qd[b.arm.is_moving[:, j], j] for b in self.rows.balances]
        low, middle, high = np.quantile(np.abs(np.concatenate(rates)), [0.05, 0.5, 0.95])
        return bool(high - low < ONE_SPEED * middle)


@dataclass(frozen=True, eq=False)
class JointChannel:
    """What is left of one joint's torque.

    Args:
        motions: Of the arm. j: Number of the joint.
        chosen: Numbers of the causes whose size is free.
        loud: Share of what is left whose square grows with that of the rate.
    """

    motions: ArmMotions
    j: int
    chosen: tuple[int, ...]
    loud: float = 0.0

    @property
    def place(self) -> str:
        """The joint."""
        return self.motions.rows.robot.joints[self.j]

    @cached_property
    def rows(self) -> JointRows:
        """Where it moves."""
        return self.motions.rows.joints[self.j]

    @property
    def extent(self) -> Extent:
        """What the motion covers."""
        return self.motions.extent

    @property
    def times(self) -> Array:
        """(R,) of rows, each of its recording [s]."""
        return self.motions.rows.joint_times(self.j)

    @cached_property
    def part(self) -> IntArray:
        """(R,) number of the part of each row: recordings, or fifths of one."""
        recording = self.motions.rows.recording[self.rows.block]
        if len(np.unique(recording)) > 1:
            return np.unique(recording, return_inverse=True)[1]
        return np.arange(len(recording)) * BLOCKS // len(recording)

    @cached_property
    def laws(self) -> Sequence[Law]:
        """That may be."""
        robot = self.motions.rows.robot
        balances = self.motions.rows.balances
        extras = [
            n for n in balances[0].motion.extra if all(n in b.motion.extra for b in balances)
        ]
        laws = joint_laws(self.place, robot.ways(robot.joints), extras, self.motions.extent)
        if len(balances) > 1:  # each has a clock of its own
            return laws
        return [*laws, *time_sines(max(float(np.ptp(self.times)), 1e-9))]

    def likeliest(self, laws: Sequence[Law]) -> JointChannel:
        """With the noise that is likeliest beside some laws."""

        def likelihood(channel: JointChannel) -> float:
            nothing = np.zeros((len(channel.terms.data), 0))
            columns = np.concatenate([nothing, *channel.columns(laws)], axis=1)
            return channel.terms.level(columns).likelihood

        return max(self._noises, key=likelihood)

    @cached_property
    def _noises(self) -> Sequence[JointChannel]:
        """The same with noise that grows with the rate more or less."""
        return [self if s == self.loud else replace(self, loud=s) for s in _LOUD]

    @cached_property
    def terms(self) -> SpectralTerms:
        """The leftover's; shapes of friction that no cause has are laws, not tolerances."""
        rows = self.motions.rows
        every = enumerate(rows.candidates)
        absent = [i for i, c in every if c.kind.id in _SHAPES and i not in self.chosen]
        deviations = rows.deviations(self.chosen, absent)
        is_free = np.zeros(len(deviations), dtype=bool)
        for i in self.chosen:
            is_free[rows.places[i]] = True
        own = self.rows
        return SpectralTerms.of(own.torque, own.columns * deviations, is_free, self.whitened)

    def columns(self, laws: Sequence[Law]) -> list[Array]:
        """(M, k) terms of the columns of each law; what is slow passes the filters unchanged."""
        timed = [law for law in laws if law.inputs == ('time',)]
        others = [law for law in laws if law.inputs != ('time',)]
        rows = [law.form([self.times], law.options) for law in timed]
        rows += [self._filtered(others)] if others else []
        if not rows:
            return []
        own = cosines(self.whitened(np.concatenate(rows, axis=1)))
        ends = np.cumsum([len(law.form.powers) for law in (*timed, *others)])[:-1].tolist()
        found = dict(zip(map(id, (*timed, *others)), np.split(own, ends, axis=1), strict=True))
        return [found[id(law)] for law in laws]

    def of_causes(self, causes: Sequence[int]) -> Array:
        """(M, k) terms of the columns of causes."""
        rows = self.motions.rows
        places = np.concatenate([np.zeros(0, dtype=int), *(rows.places[i] for i in causes)])
        return cosines(self.whitened(self.rows.columns[:, places]))

    def _filtered(self, laws: Sequence[Law]) -> Array:
        """(R, c) rows of the torques of laws by their coefficients."""
        rows = []
        for run, balance in enumerate(self.motions.rows.balances):
            values = [law.form(self.motions.inputs(law, run), law.options) for law in laws]
            every = np.concatenate(values, axis=1)
            in_rows = balance.in_rows(every, np.full(every.shape[1], self.j))
            rows.append(in_rows[self.motions.rows.rows_at(balance, self.j)])
        return np.concatenate(rows)

    def whitened(self, values: Array) -> Array:
        """(R, c) values whitened by the level as it was found before any law."""
        gains = self._gains
        scale = np.exp(0.5 * np.mean(np.log(gains.every)))  # so that likelihoods can be compared
        return np.asarray(scale * gains.whitened(values / self._loudness[:, None]))

    @cached_property
    def _gains(self) -> KalmanGains:
        """Of rows by their loudness, each of which has a level of its own.

        A drift of friction that is seen where the joint is slow, and the noise small, is none
        beside noise that is thought to be the same all along.
        """
        rows, own = self.motions.rows, self.rows.over(self._loudness)
        deviations, friction = rows.deviations(self.chosen), self.motions.friction
        variances = leftover_level(rows, self.j, deviations, friction, own)
        return KalmanGains.of(own.observed, own.gap, variances)

    @cached_property
    def _loudness(self) -> Array:
        """(R,) deviation of the noise of each row, of which the geometric mean is 1.

        So that likelihoods under several can be compared.
        """
        balances, rows = self.motions.rows.balances, self.motions.rows
        rate = np.concatenate(
            [b.motion.qd[:: b.arm.stride, self.j][rows.rows_at(b, self.j)] for b in balances]
        )
        square = 1.0 - self.loud + self.loud * rate**2 / np.mean(rate**2)
        return np.asarray(np.exp(0.5 * (np.log(square) - np.mean(np.log(square)))))

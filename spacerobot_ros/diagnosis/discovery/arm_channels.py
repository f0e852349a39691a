"""Channels of an arm: what is left of each joint's torque, and what laws would make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...effects.law_inputs import input_of
from ...estimation.arm_rows import ArmRows
from ...estimation.leftover import JointRows
from ...types import Array, IntArray
from .possible_laws import Extent, Law, joint_laws
from .spectral_terms import SpectralTerms, cosines
from .time_sines import TimeSines

FIFTHS = 5
_SHAPES = ('joint_stribeck_friction', 'joint_friction_curvature')


@dataclass(frozen=True, eq=False)
class ArmMotions:
    """Inputs of laws along all recordings of an arm.

    Args:
        rows: The recordings.
    """

    rows: ArmRows

    @cached_property
    def extent(self) -> Extent:
        """What all recordings cover together."""
        motions = [b.motion for b in self.rows.balances]
        q, qd = (np.concatenate(x) for x in zip(*((m.q, m.qd) for m in motions), strict=True))
        duration = max(float(np.ptp(m.time)) for m in motions)
        return Extent.of(self.rows.robot.joints, q, qd, duration)

    def inputs(self, law: Law, run: int) -> list[Array]:
        """(N,) inputs of a law along a recording."""
        motion = self.rows.balances[run].motion
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


@dataclass(frozen=True, eq=False)
class JointChannel:
    """What is left of one joint's torque.

    Args:
        motions: Of the arm. j: Number of the joint. variances: (6,) of its leftover.
        chosen: Numbers of the causes whose size is free.
    """

    motions: ArmMotions
    j: int
    variances: Array
    chosen: tuple[int, ...]

    @property
    def place(self) -> str:
        """The joint."""
        return self.motions.rows.robot.joints[self.j]

    @cached_property
    def rows(self) -> JointRows:
        """Where it moves."""
        return self.motions.rows.joints[self.j]

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
        return np.arange(len(recording)) * FIFTHS // len(recording)

    @property
    def speed(self) -> Array:
        """(N,) of the joint where it moves [rad/s]."""
        parts = [
            np.abs(b.motion.qd[b.arm.is_moving[:, self.j], self.j])
            for b in self.motions.rows.balances
        ]
        return np.concatenate(parts)

    @cached_property
    def laws(self) -> Sequence[Law]:
        """That may be."""
        robot = self.motions.rows.robot
        balances = self.motions.rows.balances
        extras = [
            n for n in balances[0].motion.extra if all(n in b.motion.extra for b in balances)
        ]
        return joint_laws(self.place, robot.joints, extras, self.motions.extent)

    @cached_property
    def clocks(self) -> TimeSines | None:
        """Of a single recording: others have clocks of their own."""
        if len(self.motions.rows.balances) > 1:
            return None
        return TimeSines(self.times)

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

    @property
    def all_columns(self) -> Sequence[Array]:
        """(M, k) terms of every law's columns; filters take all of them at once."""
        ends = np.cumsum([len(law.form.powers) for law in self.laws])[:-1].tolist()
        return np.split(self._columns(self.laws), ends, axis=1)

    def columns(self, law: Law) -> Array:
        """(M, k) terms of a law's columns."""
        return self._columns([law])

    def _columns(self, laws: Sequence[Law]) -> Array:
        """(M, c) terms of the torques of laws by their coefficients."""
        rows = []
        for run, balance in enumerate(self.motions.rows.balances):
            values = [law.form(self.motions.inputs(law, run), law.options) for law in laws]
            in_rows = balance.in_rows(np.concatenate(values, axis=1))
            rows.append(in_rows[self.motions.rows.rows_at(balance, self.j)])
        return cosines(self.whitened(np.concatenate(rows)))

    def whitened(self, values: Array) -> Array:
        """(R, c) values whitened by the level as it was found before any law."""
        own = self.rows
        rows = JointRows(np.zeros(len(values)), values, own.observed, own.block, own.gap)
        return rows.whitened(self.variances)[1]

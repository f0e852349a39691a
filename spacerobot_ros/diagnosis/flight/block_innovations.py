"""Whitened innovations of one block of a flight, whose state is carried on from the last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ...estimation.filters.prediction import Columns, Innovations, MeasuredMotion
from ...estimation.filters.torque_process import TorqueDriven
from ...estimation.trajectory.reference import NoiseLevels
from ...estimation.trajectory.time_base import RowIndex, TimeBase
from ...recording.record import Record
from ...types import Array, IntArray

_UNKNOWN_TORQUE = 0.1  # on the base, of what the noise of one effort amounts to


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Whitened innovations of one block.

    Args:
        channel: (R,) index into `grid.CHANNELS`. axis: (R,). time: (R,) [s].
        data: (R,) of the data.
        lasting: (R, K) of a unit error of each probe that is there since long.
        sudden: (R, K) of one that begins with the block.
        pulses: (R, W, m) of a unit torque on the base along inertial axes, and on joints, during
            each of the W newest blocks, the newest first.
    """

    channel: IntArray
    axis: IntArray
    time: Array
    data: Array
    lasting: Array
    sudden: Array
    pulses: Array

    def scaled(self, spread: Array) -> Block:
        """The block where a right model leaves (4,) `spread` in `CHANNELS` instead of one."""
        scale = spread[self.channel]
        return replace(
            self,
            data=self.data / scale,
            lasting=self.lasting / scale[:, None],
            sudden=self.sudden / scale[:, None],
            pulses=self.pulses / scale[:, None, None],
        )


def joined(parts: Sequence[Block]) -> Block:
    """Parts of a flight as one block."""
    values = (np.concatenate([getattr(b, x.name) for b in parts]) for x in fields(Block))
    return Block(*values)


class BlockMotion(MeasuredMotion):
    """A record around a block, filtered only within it.

    Args:
        record: The block and a little more on either side, for the reference.
        noise: Noise levels.
        process: The model.
        start: The block's beginning, whose own rows the last block has had [s]; None: the
            record's beginning, rows included.
        end: The block's end [s].
    """

    def __init__(
        self,
        record: Record,
        noise: NoiseLevels,
        process: TorqueDriven,
        start: float | None,
        end: float,
    ) -> None:
        super().__init__(record, noise, process)
        self.time_base = _cut(self.time_base, start, end)
        self.rows = self.time_base.rows
        self.kinematics = self.reference.at(self.time_base.times)


class BlockInnovations(Innovations):
    """The filter over one block.

    Args:
        measured: The block.
        process: The model.
        timing: How efforts act.
        covariance: (d, d) at the block's beginning; None where nothing is known of the state.
    """

    def __init__(
        self,
        measured: MeasuredMotion,
        process: TorqueDriven,
        timing: str,
        covariance: Array | None = None,
    ) -> None:
        self._covariance = covariance
        super().__init__(measured, process, timing)

    @property
    def covariance(self) -> Array:
        """(d, d) at the block's end."""
        return self._gains.end

    def run(self, columns: Columns, mean: Array) -> Array:
        """(R, 1 + K) whitened innovations of the data and of columns.

        Args:
            columns: K columns.
            mean: (d, 1 + K) state at the beginning; on return that at the end.
        """
        rates = -columns.acceleration
        still = np.zeros((*rates.shape[:2], 1))
        return self._whiten(
            np.concatenate([still, rates], axis=2),
            self._defects(),
            np.column_stack([self.deviations, self.time_base.rows.of(columns.measured)]),
            mean,
        )

    def _unknown(self) -> Array:
        """A little torque on the base that nobody knows, so that the memory is finite.

        Without it the whole's angular momentum is kept for ever, and what discretization makes of
        it in minutes would pass for a torque.
        """
        unknown = super()._unknown()
        base = self.m - self.n
        if not base or self.record.effort is None:
            return unknown
        interval = float(np.median(np.diff(self.record.effort_time)))
        impulse = _UNKNOWN_TORQUE * self.noise.joint_effort * np.sqrt(interval * self.durations)
        by_impulse = np.einsum('nii->ni', self.rate_by_impulse[:-1, :base, :base])
        rates = np.arange(self.m, self.m + base)
        unknown[:, rates, rates] += (by_impulse * impulse[:, None]) ** 2
        return unknown

    def _start(self) -> Array:
        return super()._start() if self._covariance is None else self._covariance


def _cut(base: TimeBase, start: float | None, end: float) -> TimeBase:
    """The time base from one time to another, without the first one's rows."""
    i0 = 0 if start is None else int(np.argmin(np.abs(base.times - start)))
    i1 = int(np.argmin(np.abs(base.times - end)))
    rows, first = base.rows, base.rows.first
    r0, r1 = first[i0 if start is None else i0 + 1], first[i1 + 1]
    begins = np.maximum(first[i0 : i1 + 2] - r0, 0)
    part, steps = slice(r0, r1), slice(i0, i1)
    return replace(
        base,
        times=base.times[i0 : i1 + 1],
        rows=RowIndex(
            begins, rows.state[part], rows.channel[part], rows.axis[part], rows.sample[part]
        ),
        interval=base.interval[steps],
        fresh=base.fresh[steps],
        fraction=base.fraction[steps],
        blind=base.blind[steps],
    )

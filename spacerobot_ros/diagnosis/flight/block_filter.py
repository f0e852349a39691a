"""The diagnosis' filter, carried on from block to block in flight.

Each block is linearised about its own reference; what the filter believes at its end is expressed
about the next block's reference. Beside the data, columns run through the same filter: the unknown
wheel momentum of the captured body (`monitor_momentum`), and one for every channel in which the
model may fail (`monitor_probes`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ...estimation.prediction import Columns, Innovations, MeasuredMotion
from ...estimation.reference import Kinematics, NoiseLevels
from ...estimation.time_base import RowIndex, TimeBase
from ...estimation.torque_process import TorqueDriven
from ...recording.record import Record
from ...types import Array, IntArray
from .probes import Probe
from .wheel_momentum import Momentum, constant_pass, momentum_forces

_UNKNOWN_TORQUE = 0.1  # on the base, of what the noise of one effort amounts to
_LOST = 1.5  # usual intervals, from which on an effort sample is missing


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Whitened innovations of one block.

    Args:
        channel: (R,) index into `grid.CHANNELS`. axis: (R,). time: (R,) [s].
        data: (R,) of the data.
        lasting: (R, K) of a unit error of each probe that is there since long.
        sudden: (R, K) of one that begins with the block.
    """

    channel: IntArray
    axis: IntArray
    time: Array
    data: Array
    lasting: Array
    sudden: Array

    def scaled(self, spread: Array) -> Block:
        """The block where a right model leaves (4,) `spread` in `CHANNELS` instead of one."""
        scale = spread[self.channel]
        return replace(
            self,
            data=self.data / scale,
            lasting=self.lasting / scale[:, None],
            sudden=self.sudden / scale[:, None],
        )


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

    def _effort_variance(self) -> Array:
        """As without lost samples, and what the torque may have done where one was lost."""
        variance = super()._effort_variance()
        effort = self.record.effort
        if effort is None:
            return variance
        lengths = np.diff(self.record.effort_time)
        lost = lengths > _LOST * np.median(lengths)
        at = self.time_base.interval
        if self.timing == 'held_after':  # the sample that enters serves the interval behind it
            at = np.minimum(at + 1, len(lost) - 1)
        variance[lost[at]] += np.mean(np.diff(effort, axis=0) ** 2, axis=0)
        return variance

    def _extra_variance(self) -> Array:
        """A little torque on the base that nobody knows, so that the memory is finite.

        Without it the whole's angular momentum is kept for ever, and what discretisation makes of
        it in minutes would pass for a torque.
        """
        extra = super()._extra_variance()
        base = self.m - self.n
        if not base or self.record.effort is None:
            return extra
        interval = float(np.median(np.diff(self.record.effort_time)))
        impulse = _UNKNOWN_TORQUE * self.noise.joint_effort * np.sqrt(interval * self.durations)
        by_impulse = np.einsum('nii->ni', self.rate_by_impulse[:-1, :base, :base])
        extra[:, self.m : self.m + base] = (by_impulse * impulse[:, None]) ** 2
        return extra

    def _start(self) -> Array:
        return super()._start() if self._covariance is None else self._covariance


class FlightFilter:
    """Innovations of a flight, block by block.

    Args:
        process: The model.
        noise: Noise levels.
        timing: How efforts act.
        probes: Channels in which the model may fail.
        momentum: What is known of the captured wheels beside the model.
    """

    def __init__(
        self,
        process: TorqueDriven,
        noise: NoiseLevels,
        timing: str,
        probes: Sequence[Probe],
        momentum: Momentum,
    ) -> None:
        self.process, self.timing, self.probes = process, timing, tuple(probes)
        self._noise = noise
        self._p = len(momentum.mean)
        self._covariance: Array | None = None
        self._reference: Kinematics | None = None
        self._mean = np.zeros((0, 0))
        self._share = np.zeros((self._p, 1 + 2 * len(self.probes)))
        self.momentum = momentum

    @property
    def momentum(self) -> Momentum:
        """What is believed of the captured wheels beside the model."""
        return Momentum(self._share[:, 0].copy(), self._momentum_covariance.copy())

    @momentum.setter
    def momentum(self, momentum: Momentum) -> None:
        self._share[:, 0] = momentum.mean
        self._momentum_covariance = momentum.covariance.copy()

    def restart(self) -> None:
        """Forget the state, as after a gap; what is known of the momentum stays."""
        self._covariance = None

    def block(self, record: Record, end: float) -> Block:
        """Filter up to a time.

        Args:
            record: From a little before the last block's end to a little after this one's.
            end: The block's end [s].
        """
        start = None
        if self._covariance is not None and self._reference is not None:
            start = float(self._reference.time[0])
        process = self.process.under(record)
        measured = BlockMotion(record, self._noise, process, start, end)
        filtered = BlockInnovations(measured, process, self.timing, self._covariance)
        columns = self._columns(filtered)
        self._carry(filtered, columns.acceleration.shape[2])
        rows = filtered.run(columns, self._mean)
        self._covariance = filtered.covariance
        self._reference = measured.reference.at(filtered.time_base.times[-1:])
        white = self._without_momentum(rows)
        k, at = len(self.probes), filtered.time_base.rows
        return Block(
            at.channel,
            at.axis,
            filtered.row_times,
            white[:, 0],
            white[:, 1 : 1 + k],
            white[:, 1 + k :],
        )

    def _columns(self, filtered: BlockInnovations) -> Columns:
        """Of the momentum, of lasting errors, of sudden ones."""
        record, n = filtered.record, filtered.n
        momentum = filtered.accelerations(momentum_forces(filtered.motion, filtered.process.robot))
        count = len(self.probes)
        driven = np.zeros((len(filtered.time_base.times), filtered.m, count))
        sizes = {
            'joint_position': (len(record.joint_time), n),
            'joint_velocity': (len(record.joint_time), n),
            'gyro': (len(record.rate_time), 3),
            'attitude': (len(record.attitude_time), 3),
        }
        measured = {name: np.zeros((*size, count)) for name, size in sizes.items()}
        for k, probe in enumerate(self.probes):
            if probe.push is not None:
                driven[:, :, k] = filtered.rate_by_impulse[:, :, probe.push]
            else:
                measured[probe.channel][:, probe.axis, k] = 1.0
        none = {name: np.zeros((*size, self._p)) for name, size in sizes.items()}
        return Columns(
            np.concatenate([momentum, driven, driven], axis=2),
            {c: np.concatenate([none[c], x, x], axis=2) for c, x in measured.items()},
        )

    def _carry(self, filtered: BlockInnovations, columns: int) -> None:
        """Express the state about the block's reference; sudden errors begin anew."""
        last, first = self._reference, filtered.reference.at(filtered.time_base.times[:1])
        d = 2 * (filtered.m + filtered.n)
        begun = 1 + self._p + len(self.probes)
        if self._covariance is None or last is None:
            self._mean = np.zeros((d, 1 + columns))
            self._share[:, 1:] = 0.0
            return
        self._mean[:, begun:] = 0.0
        self._share[:, 1 + len(self.probes) :] = 0.0
        mean, m, base = self._mean[:, 0], filtered.m, filtered.m - filtered.n
        mean[base:m] += last.q[0] - first.q[0]
        mean[m + base : 2 * m] += last.qd[0] - first.qd[0]
        if base:
            attitude = last.rotation[0] * Rotation.from_rotvec(mean[:3])
            mean[:3] = (first.rotation[0].inv() * attitude).as_rotvec()
            mean[m : m + 3] += last.omega[0] - first.omega[0]

    def _without_momentum(self, rows: Array) -> Array:
        """(R, 1 + 2 K) innovations that are white whatever the momentum is."""
        p = self._p
        values = np.concatenate([rows[:, :1], rows[:, 1 + p :]], axis=1)
        if not p:
            return values
        return np.asarray(
            constant_pass(
                values,
                np.ascontiguousarray(rows[:, 1 : 1 + p]),
                self._share,
                self._momentum_covariance,
            )
        )


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

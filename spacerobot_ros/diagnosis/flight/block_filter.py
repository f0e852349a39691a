"""The diagnosis' filter, carried on from block to block in flight.

Each block is linearized about its own reference; what the filter believes at its end is expressed
about the next block's reference. Beside the data, columns run through the same filter: the unknown
wheel momentum of the captured body (`wheel_momentum`), one for every channel in which the model
may fail (`probes`), and torques from outside in the newest blocks (`event_watch`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from ...estimation.filters.prediction import Columns
from ...estimation.filters.torque_process import TorqueDriven
from ...estimation.trajectory.reference import Kinematics, NoiseLevels
from ...recording.record import Record
from ...types import Array
from .block_innovations import Block, BlockInnovations, BlockMotion
from .probes import Probe
from .wheel_momentum import Momentum, constant_pass, momentum_forces


class FlightFilter:
    """Innovations of a flight, block by block.

    Args:
        process: The model.
        noise: Noise levels.
        timing: How efforts act.
        probes: Channels in which the model may fail.
        momentum: What is known of the captured wheels beside the model.
        kept: Number of the newest blocks in each of which a torque may have acted.
    """

    def __init__(
        self,
        process: TorqueDriven,
        noise: NoiseLevels,
        timing: str,
        probes: Sequence[Probe],
        momentum: Momentum,
        kept: int = 1,
    ) -> None:
        self.process, self.timing, self.probes = process, timing, tuple(probes)
        self._kept, self._newest = kept, 0
        self._noise = noise
        self._p = len(momentum.mean)
        self._covariance: Array | None = None
        self._reference: Kinematics | None = None
        self._mean = np.zeros((0, 0))
        self._share = np.zeros((self._p, 1 + 2 * len(self.probes) + kept * process.m))
        self.momentum = momentum

    @property
    def momentum(self) -> Momentum:
        """What is believed of the captured wheels beside the model."""
        return Momentum(self._share[:, 0].copy(), self._momentum_covariance.copy())

    @momentum.setter
    def momentum(self, momentum: Momentum) -> None:
        self._share[:, 0] = momentum.mean
        self._momentum_covariance = momentum.covariance.copy()

    def restart(self, *, is_continued: bool = False) -> None:
        """Forget the state; what is known of the momentum stays.

        Args:
            is_continued: Whether the next block follows the last; else there is a gap.
        """
        self._covariance = None
        if not is_continued:
            self._reference = None

    def block(self, record: Record, end: float, begins: bool = True) -> Block:
        """Filter up to a time.

        Args:
            record: From a little before the last block's end to a little after this one's.
            end: The block's end [s].
            begins: Whether sudden errors begin with it, not with an earlier one.

        Raises:
            FloatingPointError: samples so large that predictions from them are no numbers.
        """
        start = None if self._reference is None else float(self._reference.time[0])
        process = self.process.under(record)
        measured = BlockMotion(record, self._noise, process, start, end)
        filtered = BlockInnovations(measured, process, self.timing, self._covariance)
        self._newest = (self._newest + 1) % self._kept
        columns = self._columns(filtered)
        self._propagate(filtered, columns.acceleration.shape[2], begins)
        rows = filtered.run(columns, self._mean)
        if not np.isfinite(rows).all():  # not all of LAPACK's routines refuse them before
            raise FloatingPointError('predictions from them are not finite')
        self._covariance = filtered.covariance
        self._reference = measured.reference.at(filtered.time_base.times[-1:])
        white = self._without_momentum(rows)
        k, at = len(self.probes), filtered.time_base.rows
        pulses = white[:, 1 + 2 * k :].reshape(len(white), self._kept, -1)
        return Block(
            at.channel,
            at.axis,
            filtered.row_times,
            white[:, 0],
            white[:, 1 : 1 + k],
            white[:, 1 + k : 1 + 2 * k],
            pulses[:, (self._newest - np.arange(self._kept)) % self._kept],
        )

    def _columns(self, filtered: BlockInnovations) -> Columns:
        """Of the momentum, of lasting errors, of sudden ones, of torques in the newest blocks."""
        record, n = filtered.record, filtered.n
        momentum = filtered.accelerations(momentum_forces(filtered.motion, filtered.process.robot))
        count, p = len(self.probes), self._p
        driven = np.zeros((len(filtered.time_base.times), filtered.m, count))
        sizes = {
            'joint_position': (len(record.joint_time), n),
            'joint_velocity': (len(record.joint_time), n),
            'gyro': (len(record.rate_time), 3),
            'attitude': (len(record.attitude_time), 3),
        }
        width = p + 2 * count + self._kept * filtered.m
        measured = {name: np.zeros((*size, width)) for name, size in sizes.items()}
        for k, probe in enumerate(self.probes):
            if probe.driven is not None:
                driven[:, :, k] = filtered.rate_by_impulse[:, :, probe.driven]
            else:
                measured[probe.channel][:, probe.axis, [p + k, p + count + k]] = 1.0
        pulses = np.zeros((len(driven), filtered.m, self._kept, filtered.m))
        pulses[:, :, self._newest] = filtered.rate_by_impulse
        if filtered.m > filtered.n:  # along inertial axes
            into_base = np.swapaxes(filtered.kinematics.matrices, 1, 2)
            pulses[:, :, self._newest, :3] = filtered.rate_by_impulse[:, :, :3] @ into_base
        torques = pulses.reshape(len(driven), filtered.m, -1)
        return Columns(np.concatenate([momentum, driven, driven, torques], axis=2), measured)

    def _propagate(self, filtered: BlockInnovations, columns: int, begins: bool) -> None:
        """Express the state about the block's reference; what begins with it begins anew."""
        last, first = self._reference, filtered.reference.at(filtered.time_base.times[:1])
        d = filtered.size
        k = len(self.probes)
        newest = 1 + 2 * k + self._newest * filtered.m
        if self._covariance is None or last is None:
            self._mean = np.zeros((d, 1 + columns))
            self._share[:, 1:] = 0.0
            return
        begun = [slice(newest, newest + filtered.m)]
        if begins:
            begun.append(slice(1 + k, 1 + 2 * k))
        for part in begun:
            self._share[:, part] = 0.0
            self._mean[:, part.start + self._p : part.stop + self._p] = 0.0
        mean, m, base = self._mean[:, 0], filtered.m, filtered.m - filtered.n
        mean[base:m] += last.q[0] - first.q[0]
        mean[m + base : 2 * m] += last.qd[0] - first.qd[0]
        if base:
            attitude = last.rotation[0] * scipy.spatial.transform.Rotation.from_rotvec(mean[:3])
            mean[:3] = (first.rotation[0].inv() * attitude).as_rotvec()
            mean[m : m + 3] += last.omega[0] - first.omega[0]

    def _without_momentum(self, rows: Array) -> Array:
        """(R, 1 + C) innovations that are white whatever the momentum is."""
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

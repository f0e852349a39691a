"""The torque-driven filter as rows for the engine, and what it leaves of every channel."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from ...effects.effect import CHANNELS as SENSORS
from ...effects.motion import Motion
from ...inference.gram import Gram
from ...model.robot import Robot
from ...types import Array, IntArray
from ..inference.whiteness import whiteness
from ..rows import ChannelError, ChannelFit
from ..trajectory.reference import Kinematics
from ..trajectory.time_base import CHANNELS
from .measured_torque import TIMINGS
from .prediction import Columns, Innovations

_WINDOW = 0.5  # s
_MEMORY = 4.0  # s; after which the filter has forgotten a torque
_START = 1.0  # s
_SETTLED = 0.1  # s; before which it is still finding the state
LABELS = {
    'joint_position': ('joint_position', 'rad'),
    'joint_velocity': ('joint_rate', 'rad/s'),
    'gyro': ('gyro', 'rad/s'),
    'attitude': ('attitude', 'rad'),
    'base_position': ('base_position', 'm'),
}


class PredictionRows(Innovations):
    """Innovations as `rows.Rows`."""

    @property
    def robot(self) -> Robot:
        """The robot as the model's effects make it."""
        return self.process.robot

    @property
    def is_held(self) -> bool:
        """See `Rows.is_held`."""
        return TIMINGS[self.timing] is not None

    @cached_property
    def effort_rate(self) -> Array:
        """(N, n) time derivative of the measured torques [N m/s]."""
        return self.reference.effort(self.time_base.times, 1)

    def samples(self) -> Mapping[str, tuple[Kinematics, Motion]]:
        """See `Rows.samples`."""
        return self._samples

    @cached_property
    def _samples(self) -> dict[str, tuple[Kinematics, Motion]]:
        out = {}
        for channel in SENSORS:
            kinematics = self.at_samples(channel)
            if channel in CHANNELS and len(kinematics.time):
                effort = self.reference.effort(kinematics.time)
                out[channel] = kinematics, self.process.motion(kinematics, effort)
        return out

    def whitened(self, forces: Array, measured: Mapping[str, Array]) -> Array:
        """(R, K); see `Rows.whitened`."""
        return self.columns(Columns(self.accelerations(forces), dict(measured)))

    def whiteness(self) -> tuple[float, tuple[ChannelFit, ...]]:
        """See `Rows.whiteness`."""
        return whiteness(self.time_base, self.data)

    def channels(self) -> tuple[ChannelError, ...]:
        """Unexplained torques, then prediction errors of every sensor's axis."""
        out = []
        for c, name in enumerate(CHANNELS):
            label, unit = LABELS[name]
            is_joint = name.startswith('joint')
            for axis, axis_name in enumerate(self.robot.joints if is_joint else 'xyz'):
                at = self._settled_rows(c, axis)
                if len(at):
                    out.append(
                        ChannelError(
                            f'{label}/{axis_name}',
                            self.robot.unit_of(unit, axis_name) if is_joint else unit,
                            self.row_times[at],
                            self.measured[at],
                            (self.data * self.stds)[at],
                            float(np.sqrt(np.mean(self.stds[at] ** 2))),
                        )
                    )
        return (*self._torques(), *out)

    def _torques(self) -> list[ChannelError]:
        """Unexplained torque on joints and base, window by window.

        On the base a torque is the rate at which angular momentum seems to change.
        """
        time, values, spread = self._window_torques()
        base = self.m - self.n
        names = [f'angular_momentum/{axis}' for axis in 'xyz'[:base]]
        names += [f'joint_torque/{joint}' for joint in self.robot.joints]
        units = ['N m'] * base + [self.robot.unit_of('N m', joint) for joint in self.robot.joints]
        floor, none = np.sqrt(np.mean(spread**2, axis=0)), np.zeros(0)
        return [
            ChannelError(names[i], units[i], time, none, values[:, i], float(floor[i]))
            for i in [*range(base, self.m), *range(base)]
        ]

    def _window_torques(self) -> tuple[Array, Array, Array]:
        """Middle of each window, (M, m) constant torques that explain it best, and their stds.

        Windows far enough apart do not see each other, so their columns are computed together.
        """
        times, m = self.time_base.times, self.m
        count = max(1, int((times[-1] - times[0] - _START - _MEMORY) / _WINDOW))
        # the first second still finds the state
        starts = times[0] + _START + _WINDOW * np.arange(count)
        apart = round(_MEMORY / _WINDOW)
        values, spread = np.zeros((count, m)), np.zeros((count, m))
        for comb in range(min(apart, count)):
            phase = (times - starts[0]) / _WINDOW
            inside = (phase >= 0.0) & ((np.floor(phase).astype(int) - comb) % apart == 0)
            columns = self.columns(Columns(self.rate_by_impulse * inside[:, None, None], {}))
            for w in range(comb, count, apart):
                rows = (self.row_times >= starts[w]) & (self.row_times < starts[w] + _MEMORY)
                gram = Gram.of(columns[rows], self.data[rows])
                inverse = np.linalg.pinv(gram.matrix, hermitian=True)
                values[w] = inverse @ gram.vector
                spread[w] = np.sqrt(np.diag(inverse))
        return starts + 0.5 * _WINDOW, values, spread

    def _settled_rows(self, channel: int, axis: int) -> IntArray:
        """Rows of one axis once the state is found."""
        rows = self.time_base.rows
        settled = self.row_times > self.time_base.times[0] + _SETTLED
        return np.flatnonzero(settled & (rows.channel == channel) & (rows.axis == axis))

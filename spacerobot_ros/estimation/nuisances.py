r"""Unknowns that are estimated beside the momentum and the inertial parameters, each as columns.

Every one is an effect of the catalogue (docs/effects.md, the same ids) seen as a small, constant
unknown:

    gyro_bias                 y = w + b
    encoder_offset            y = q + o, one a joint
    imu_delay                 y(t) = w(t - d)              ~ w - w' d
    attitude_delay            R_measured(t) = R(t - d)     ~ R exp(-w d)
    torque_hold               y(t) = w(t) - k s(t) j, likewise the joint rates (torque_hold.py)
    external_torque_inertial  h_W(t) = h_W + T t
    target_wheel_drag         h_b(t) = h_b exp(-t/tau), unknown 1/tau
    servicer_wheel_drag       h_0(t) = h_0 exp(-t/tau), unknown 1/tau

The first five act in a measurement, the others in the momentum equation. Times count from the
first sample of a run; delays count against the joint states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError
from ..types import Array
from .torque_hold import Holds

_KINDS: dict[str, tuple[str, float]] = {  # unit, prior standard deviation
    'gyro_bias': ('rad/s', 1e-3),
    'encoder_offset': ('rad', 1e-2),
    'imu_delay': ('s', 0.1),
    'attitude_delay': ('s', 0.5),
    'torque_hold': ('s^2', 1e-4),
    'external_torque_inertial': ('N m', 1.0),
    'target_wheel_drag': ('1/s', 1e-2),
    'servicer_wheel_drag': ('1/s', 1e-2),
}
NUISANCES = tuple(_KINDS)


@dataclass(frozen=True, slots=True, eq=False)
class SensorColumns:
    """Derivatives of the measurements by the m nuisances at N times.

    Args:
        q: (N, n, m) of joint positions.
        qd: (N, n, m) of joint rates.
        gyro: (N, 3, m) of the body rate.
        attitude: (N, 3, m) of the rotation vector.
    """

    q: Array
    qd: Array
    gyro: Array
    attitude: Array

    @classmethod
    def none(cls, count: int, n: int) -> SensorColumns:
        """No nuisance at all."""
        joints, axes = np.zeros((count, n, 0)), np.zeros((count, 3, 0))
        return cls(joints, joints, axes, axes)


class Nuisances:
    """The nuisances of one estimate, in a row.

    Args:
        kinds: Effect ids.
        n: Number of joints.

    Raises:
        ConfigurationError: an id that can not be estimated beside the momentum.
    """

    def __init__(self, kinds: tuple[str, ...], n: int) -> None:
        for i, kind in enumerate(kinds):
            if kind not in _KINDS or kind in kinds[:i]:
                known = ', '.join(NUISANCES)
                raise ConfigurationError(
                    f'identifier.nuisances[{i}]', f'{kind!r} is not one of {known}, each once'
                )
        self.kinds = kinds
        self._n = n
        self.parts: dict[str, slice] = {}
        start = 0
        for kind in kinds:
            self.parts[kind] = slice(start, start + self._width(kind))
            start += self._width(kind)
        self.size = start
        # Where the momentum equation is linear in a nuisance, its value acts through its column.
        self.linear = self.parts.get('external_torque_inertial', slice(0, 0))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each unknown, such as `gyro_bias_x`."""
        return tuple(
            name for kind in self.kinds for name in _names(kind, self._width(kind), self._n)
        )

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each unknown."""
        return tuple(_KINDS[kind][0] for kind in self.kinds for _ in range(self._width(kind)))

    def prior(self, holds: Holds | None = None) -> tuple[Array, Array]:
        """(m,) means and standard deviations: zero, and larger than any is in practice.

        Args:
            holds: When torques were set: a known period tells `torque_hold`.
        """
        mean = np.zeros(self.size)
        std = np.array([_KINDS[k][1] for k in self.kinds for _ in range(self._width(k))])
        told = None if holds is None else holds.prior()
        if told is not None and 'torque_hold' in self.parts:
            part = self.parts['torque_hold']
            mean[part], std[part] = told
        return mean, std

    def sensor_columns(self, time: Array, omega: Array, held: Array | None) -> SensorColumns:
        """Derivatives of the measurements at N times.

        Args:
            time: (N,) [s].
            omega: (N, 3) body rate [rad/s].
            held: (N, 3 + n) what holding torques takes off [omega_WB_B; q'], a unit of k
                [rad/s^3]; None where `torque_hold` is not estimated.
        """
        count = len(time)
        q, qd_columns, gyro, attitude = (
            np.zeros((count, rows, self.size)) for rows in (self._n, self._n, 3, 3)
        )
        if 'encoder_offset' in self.parts:
            q[..., self.parts['encoder_offset']] = np.eye(self._n)
        if 'gyro_bias' in self.parts:
            gyro[..., self.parts['gyro_bias']] = np.eye(3)
        if 'torque_hold' in self.parts and held is not None:
            part = self.parts['torque_hold']
            gyro[..., part] = -held[:, :3, None]
            qd_columns[..., part] = -held[:, 3:, None]
        if 'imu_delay' in self.parts and count > 2:
            gyro[..., self.parts['imu_delay']] = -np.gradient(omega, time, axis=0)[..., None]
        if 'attitude_delay' in self.parts:
            attitude[..., self.parts['attitude_delay']] = -omega[..., None]
        return SensorColumns(q, qd_columns, gyro, attitude)

    def momentum_columns(self, time: Array, R_WB: Array, wheels: Array, h0: Array) -> Array:
        """(N, 3, m) derivatives of R^T h_W - sum R_b h_b - h0 (base frame) by the nuisances.

        Args:
            time: (N,) [s].
            R_WB: (N, 3, 3) attitudes.
            wheels: (N, 3) momentum of the captured wheels in the base frame [N m s].
            h0: (N, 3) momentum of the servicer's wheels [N m s].
        """
        out = np.zeros((len(time), 3, self.size))
        if 'external_torque_inertial' in self.parts:
            back = np.swapaxes(R_WB, 1, 2)
            out[..., self.parts['external_torque_inertial']] = back * time[:, None, None]
        if 'target_wheel_drag' in self.parts:
            out[..., self.parts['target_wheel_drag']] = (wheels * time[:, None])[..., None]
        if 'servicer_wheel_drag' in self.parts:
            out[..., self.parts['servicer_wheel_drag']] = (h0 * time[:, None])[..., None]
        return out

    def decay(self, kind: str, values: Array, time: Array) -> Array:
        """(N,) share of the wheels' momentum that is left, one where drag is not estimated."""
        if kind not in self.parts:
            return np.ones(len(time))
        return np.exp(-values[self.parts[kind]][0] * time)

    def _width(self, kind: str) -> int:
        if kind == 'encoder_offset':
            return self._n
        return 3 if kind in ('gyro_bias', 'external_torque_inertial') else 1


def _names(kind: str, width: int, n: int) -> list[str]:
    if kind == 'encoder_offset':
        return [f'{kind}_{i + 1}' for i in range(n)]
    return [f'{kind}_{axis}' for axis in 'xyz'] if width == 3 else [kind]

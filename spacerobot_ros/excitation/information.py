r"""How much a motion tells of the whole estimate [AAM; x]: bits gained over the prior.

The cheap sibling of `identification.cramer_rao`: the joints count as measured, their rates with
the noise density that smoothing leaves. Unknown are the first attitude, the total momentum h_W,
and the wheel momentum and the bodies, or the linear minimal set (unknowns.py). With psi the
attitude error in the inertial frame and t the errors of the constants,

    dw = D^-1 (h_B^x R^T psi + V t),    psi' = R dw

the gyro measures dw and the star tracker psi. With F the information of the unknowns after first
attitude and h_W are eliminated and S the prior's standard deviations,

    gain = 1/2 log2 det(1 + S F S)

is the expected information of the measurement (Lindley 1956), 1 bit for every halving of an
uncertainty. A change of units changes neither it nor the motion that maximises it, unlike a
condition number, and a direction that no motion can excite adds nothing instead of spoiling all.

Symbols: B candidates, T times, p constants [h_W; AAM; x], m unknowns besides h_W.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..dynamics.rotation import skew
from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from ..model.settings import SensorSettings, SimulatorSettings
from ..types import Array
from .free_base import BaseMotion
from .unknowns import Unknowns

# Where the robot file does not state the noise: a good gyro, encoder and star tracker.
TYPICAL = SensorSettings(
    joint_position_std=2.0e-5,
    joint_velocity_std=2.0e-4,
    joint_effort_std=0.05,
    gyro_std=2.0e-5,
    attitude_std=3.0e-5,
)
_BAND = 2.0  # rad/s; encoder noise counts as rate noise of this frequency


@dataclass(frozen=True, slots=True)
class NoiseDensity:
    """Noise of continuous measurements with the same information as the samples.

    Args:
        gyro: [rad/s/sqrt(Hz)]. attitude: [rad/sqrt(Hz)]. joint_rate: [rad/s/sqrt(Hz)].
    """

    gyro: float
    attitude: float
    joint_rate: float


def with_typical(sensors: SensorSettings) -> tuple[SensorSettings, tuple[str, ...]]:
    """Sensors with typical noise where none is stated, and the names of what was not stated."""
    names = ('joint_position_std', 'joint_velocity_std', 'gyro_std', 'attitude_std')
    missing = tuple(name for name in names if getattr(sensors, name) is None)
    values = {
        name: getattr(TYPICAL if name in missing else sensors, name)
        for name in (*names, 'joint_effort_std')
    }
    return SensorSettings(**values), missing


def noise_density(sensors: SensorSettings, rates: SimulatorSettings) -> NoiseDensity:
    """Densities of fully stated sensors at the simulator's rates."""
    gyro = _stated(sensors.gyro_std) / np.sqrt(rates.imu_rate)
    attitude = _stated(sensors.attitude_std) / np.sqrt(rates.attitude_rate)
    encoder = _BAND * _stated(sensors.joint_position_std)
    joint = 1.0 / np.hypot(1.0 / encoder, 1.0 / _stated(sensors.joint_velocity_std))
    return NoiseDensity(float(gyro), float(attitude), float(joint / np.sqrt(rates.joint_rate)))


class Information:
    """The measure for one robot and one set of sensors.

    Args:
        model: Robot as assumed, and minimal set.
        noise: Sensors.
        unknowns: What is to be estimated, with its prior.
    """

    def __init__(self, model: MomentumModel, noise: NoiseDensity, unknowns: Unknowns) -> None:
        self._model, self._noise, self._unknowns = model, noise, unknowns

    def gain(self, motion: BaseMotion) -> Array:
        """(B,) bits that each candidate's measurement tells."""
        fisher = self.fisher(motion)
        sign, log = np.linalg.slogdet(np.eye(fisher.shape[-1]) + fisher)
        return np.where(sign > 0.0, 0.5 * log / np.log(2.0), -np.inf)

    def fisher(self, motion: BaseMotion) -> Array:
        """(B, m, m) information of the unknowns in units of the prior's std."""
        drive = self._drive(motion)
        psi, rate = _sensitivities(motion, drive)
        weight = self._weights(motion)
        info = _gram(weight @ rate) + _gram(psi / self._noise.attitude)
        info *= motion.time[1] - motion.time[0]
        prior_std = self._unknowns.prior_std
        return _eliminate(info, 6) * np.outer(prior_std, prior_std)

    def _drive(self, motion: BaseMotion) -> Array:
        """(B, T, 3, 3 + m) of dw by [h_W; unknowns]."""
        return motion.inverse @ (self.columns(motion) @ self._unknowns.to_constants)

    def columns(self, motion: BaseMotion) -> Array:
        """(B, T, 3, p) regressor of the momentum equation in base axes."""
        batch, steps, n = motion.q.shape
        reference = Kinematics(
            np.tile(motion.time, batch),
            motion.q.reshape(-1, n),
            motion.qd.reshape(-1, n),
            motion.omega.reshape(-1, 3),
            Rotation.from_matrix(motion.R_WB.reshape(-1, 3, 3)),
        )
        columns, _ = self._model.regressor(reference)
        return columns.reshape(batch, steps, 3, -1)

    def _weights(self, motion: BaseMotion) -> Array:
        """(B, T, 3, 3) square roots of the inverse noise density of the base rate."""
        c = motion.coupling
        noise = self._noise.joint_rate**2 * c @ np.swapaxes(c, -1, -2)
        noise = noise + self._noise.gyro**2 * np.eye(3)
        return np.linalg.inv(np.linalg.cholesky(noise))


def _sensitivities(motion: BaseMotion, drive: Array) -> tuple[Array, Array]:
    """(B, T, 3, 6 + m) psi and dw by [psi(0); h_W; unknowns], by trapezoidal steps."""
    R = motion.R_WB
    R_T = np.swapaxes(R, -1, -2)
    h_B = np.einsum('btij,bi->btj', R, motion.h_W)
    feedback = motion.inverse @ skew(h_B) @ R_T
    whole = np.concatenate([np.zeros((*drive.shape[:-1], 3)), drive], axis=-1)
    half = 0.5 * (motion.time[1] - motion.time[0])
    matrix, forcing = R @ feedback, R @ whole
    implicit = np.linalg.inv(np.eye(3) - half * matrix[:, 1:])
    carry = implicit @ (np.eye(3) + half * matrix[:, :-1])
    push = implicit @ (half * (forcing[:, 1:] + forcing[:, :-1]))
    psi = np.zeros_like(whole)
    psi[:, 0, :, :3] = np.eye(3)
    for k in range(psi.shape[1] - 1):
        psi[:, k + 1] = carry[:, k] @ psi[:, k] + push[:, k]
    return psi, feedback @ psi + whole


def _gram(rows: Array) -> Array:
    """(B, c, c) sums of squares of rows (B, T, 3, c)."""
    flat = rows.reshape(len(rows), -1, rows.shape[-1])
    return np.swapaxes(flat, 1, 2) @ flat


def _eliminate(information: Array, count: int) -> Array:
    """What remains of an information when its first `count` unknowns are eliminated."""
    mixed = information[:, :count, count:]
    first = information[:, :count, :count]
    scale = np.sqrt(np.einsum('bii->bi', first))
    unit = first / (scale[:, :, None] * scale[:, None, :])
    scaled = mixed / scale[:, :, None]
    return information[:, count:, count:] - np.swapaxes(scaled, 1, 2) @ np.linalg.solve(
        unit, scaled
    )


def _stated(std: float | None) -> float:
    if std is None:
        raise ValueError('complete the sensors with `with_typical` first')
    return std

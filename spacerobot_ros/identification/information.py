r"""How much a motion tells of the whole estimate [AAM; y]: bits gained over the prior.

The cheap sibling of `cramer_rao`: the joints count as measured, their rates with the noise density
that smoothing leaves. Unknown are the first attitude, the total momentum h_W, the gyro's bias b
where the identifier estimates it, the AAM, and the coordinates y of the bodies. With psi the
attitude error in the inertial frame and t the errors of [h_W; AAM; y],

    dw = D^-1 (h_B^x R^T psi + V t),    psi' = R dw

the gyro measures dw + b and the star tracker psi. With F the information of [AAM; y] after the
rest is eliminated and S the prior's standard deviations (`momentum_prior_std` and
`robot.uncertainty`, its factor one),

    whole = 1/2 log2 det(1 + S F S)

is the expected information of the measurement (Lindley 1956), 1 bit for every halving of an
uncertainty; that of the AAM alone is the same with all bodies eliminated. A change of units
changes neither of them nor the motion that maximizes them, unlike a condition number, and a
direction that no motion can excite adds nothing instead of spoiling all.

Symbols: B candidates, T times, m unknowns [AAM; y].
"""

from __future__ import annotations

import numpy as np

from ..dynamics.rotation import skew
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.base_response import BaseMotion
from ..estimation.trajectory.reference import NoiseLevels
from ..inference.gram import Gram
from ..model.robot_settings import SensorSettings
from ..model.settings import IdentifierSettings, SimulatorSettings
from ..types import Array

_TYPICAL = {  # where the robot file states no noise: a good gyro, encoder and star tracker
    'joint_position': 2.0e-5,
    'joint_velocity': 2.0e-4,
    'joint_effort': 0.05,  # N m; the identification does not use it
    'gyro': 2.0e-5,
    'attitude': 3.0e-5,
}
_BAND = 2.0  # rad/s; encoder noise counts as rate noise of this frequency
_BIAS = 'gyro_bias'


def with_typical(sensors: SensorSettings) -> tuple[NoiseLevels, tuple[str, ...]]:
    """Stated noise, typical where none is stated, and which settings of those used are missing."""
    levels = NoiseLevels(**{name: sensors.std(name) or std for name, std in _TYPICAL.items()})
    missing = (name for name in _TYPICAL if sensors.std(name) is None and name != 'joint_effort')
    return levels, tuple(f'{name}_std' for name in missing)


class Information:
    """The measure for one robot and one set of sensors.

    Args:
        model: Robot and unknowns.
        constants: (p,) of the model, about which it is computed; the total momentum is the
            motion's.
        noise: Of the sensors. rates: How often they sample.
        settings: The identifier's, for its prior.

    Attributes:
        prior_std: (m,) of [AAM; y], before any measurement.
    """

    def __init__(
        self,
        model: MomentumModel,
        constants: Array,
        noise: NoiseLevels,
        rates: SimulatorSettings,
        settings: IdentifierSettings,
    ) -> None:
        self._model, self._constants = model, constants
        momenta = np.full(model.n_aam, settings.momentum_prior_std)
        self.prior_std = np.concatenate([momenta, model.bodies.std])
        # densities of continuous measurements with the information of the samples, per sqrt(Hz)
        self._gyro_noise = noise.gyro / np.sqrt(rates.imu_rate)
        self._attitude_noise = noise.attitude / np.sqrt(rates.attitude_rate)
        joint = 1.0 / np.hypot(1.0 / (_BAND * noise.joint_position), 1.0 / noise.joint_velocity)
        self._rate_noise = joint / np.sqrt(rates.joint_rate)
        is_bias = np.array([name.startswith(_BIAS) for name in model.nuisances.names], dtype=bool)
        self._bias_std = model.nuisances.prior()[1][is_bias]

    def bits(self, motion: BaseMotion) -> tuple[Array, Array]:
        """(B,) bits that each candidate's measurement tells: of [AAM; y], and of the AAM alone."""
        n = self._model.n_aam
        gained = np.eye(len(self.prior_std)) + self.fisher(motion)
        whole, bodies = (0.5 * _log2_det(each) for each in (gained, gained[:, n:, n:]))
        return whole, whole - bodies

    def fisher(self, motion: BaseMotion) -> Array:
        """(B, m, m) information of [AAM; y] in units of the prior's std."""
        driven, bias = motion.inverse @ self._columns(motion), len(self._bias_std)
        psi, rate = _sensitivities(motion, np.insert(driven, bias * [3], 0.0, axis=-1))
        if bias:
            rate[..., 6 : 6 + bias] += np.eye(3)
        info = _gram(self._weights(motion) @ rate) + _gram(psi / self._attitude_noise)
        info *= motion.time[1] - motion.time[0]
        others = np.append(np.zeros(6), 1.0 / self._bias_std**2)
        grams = (Gram(one, np.zeros(len(one)), 0.0, 0) for one in info)
        left = np.stack([gram.without(len(others), others).matrix for gram in grams])
        return left * np.outer(self.prior_std, self.prior_std)

    def _columns(self, motion: BaseMotion) -> Array:
        """(B, T, 3, 3 + m) derivatives of the momentum equation by [h_W; AAM; y], in base axes."""
        _, columns = self._model.balance(motion.kinematics, self._constants)
        own = columns[..., : self._model.y.stop]
        return np.asarray(own.reshape(*motion.q.shape[:2], 3, -1))

    def _weights(self, motion: BaseMotion) -> Array:
        """(B, T, 3, 3) square roots of the inverse noise density of the base rate."""
        c = motion.coupling
        noise = self._rate_noise**2 * c @ np.swapaxes(c, -1, -2)
        noise = noise + self._gyro_noise**2 * np.eye(3)
        return np.linalg.inv(np.linalg.cholesky(noise))


def _log2_det(matrices: Array) -> Array:
    """(B,) of positive definite matrices (B, m, m)."""
    sign, log = np.linalg.slogdet(matrices)
    return np.where(sign > 0.0, log / np.log(2.0), -np.inf)


def _sensitivities(motion: BaseMotion, drive: Array) -> tuple[Array, Array]:
    """(B, T, 3, 3 + c) psi and dw by [psi(0); unknowns], by trapezoidal steps.

    Args:
        motion: Of B candidates.
        drive: (B, T, 3, c) of dw by the unknowns.
    """
    R = motion.R_WB
    R_T = np.swapaxes(R, -1, -2)
    h_B = np.einsum('btij,bi->btj', R, motion.h_W)
    feedback = motion.inverse @ skew(h_B) @ R_T
    whole = np.concatenate([np.zeros((*drive.shape[:-1], 3)), drive], axis=-1)
    half = 0.5 * (motion.time[1] - motion.time[0])
    matrix, forcing = R @ feedback, R @ whole
    implicit = np.linalg.inv(np.eye(3) - half * matrix[:, 1:])
    propagate = implicit @ (np.eye(3) + half * matrix[:, :-1])
    input_ = implicit @ (half * (forcing[:, 1:] + forcing[:, :-1]))
    psi = np.zeros_like(whole)
    psi[:, 0, :, :3] = np.eye(3)
    for k in range(psi.shape[1] - 1):
        psi[:, k + 1] = propagate[:, k] @ psi[:, k] + input_[:, k]
    return psi, feedback @ psi + whole


def _gram(rows: Array) -> Array:
    """(B, c, c) sums of squares of rows (B, T, 3, c)."""
    flat = rows.reshape(len(rows), -1, rows.shape[-1])
    return np.swapaxes(flat, 1, 2) @ flat

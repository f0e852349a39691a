r"""How much a motion tells of the whole estimate [AAM; x]: bits gained over the prior.

The cheap sibling of `identification.cramer_rao`: the joints count as measured, their rates with
the noise density that smoothing leaves. Unknown are the first attitude, the total momentum h_W,
and y: the errors of [AAM; x] themselves, or of [AAM; coordinates of the bodies], since a motion
that tells much of a linear set, which no bodies fill, need not tell much of the bodies. With psi
the attitude error in the inertial frame and t = map @ [h_W; y] the errors of the constants,

    dw = D^-1 (h_B^x R^T psi + V t),    psi' = R dw

the gyro measures dw and the star tracker psi. With F the information of the unknowns after first
attitude and h_W are eliminated and S the prior's standard deviations,

    gain = 1/2 log2 det(1 + S F S)

is the expected information of the measurement (Lindley 1956), 1 bit for every halving of an
uncertainty. A change of units changes neither it nor the motion that maximizes it, unlike a
condition number, and a direction that no motion can excite adds nothing instead of spoiling all.

Symbols: B candidates, T times, p constants [h_W; AAM; x], m unknowns besides h_W.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..dynamics.rotation import skew
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels
from ..identification.physical import BodyParameters, central_differences
from ..model.robot_settings import SensorSettings
from ..model.settings import IdentifierSettings, SimulatorSettings
from ..types import Array
from .base_response import BaseMotion

_TYPICAL = {  # where the robot file states no noise: a good gyro, encoder and star tracker
    'joint_position': 2.0e-5,
    'joint_velocity': 2.0e-4,
    'joint_effort': 0.05,  # N m; the identification does not use it
    'gyro': 2.0e-5,
    'attitude': 3.0e-5,
}
_BAND = 2.0  # rad/s; encoder noise counts as rate noise of this frequency
_RANK_TOLERANCE = 1e-8
_STEP = 1e-5  # of the bodies' coordinates, which are of order one


def with_typical(sensors: SensorSettings) -> tuple[NoiseLevels, tuple[str, ...]]:
    """Stated noise, typical where none is stated, and which settings of those used are missing."""
    levels = NoiseLevels(**{name: sensors.std(name) or std for name, std in _TYPICAL.items()})
    missing = (name for name in _TYPICAL if sensors.std(name) is None and name != 'joint_effort')
    return levels, tuple(f'{name}_std' for name in missing)


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Unknowns y, h_W before them.

    Args:
        to_constants: (p, 3 + m) map from [h_W; y] to the errors of the constants [h_W; AAM; x].
        prior_std: (m,) what is known of y before any measurement.
    """

    to_constants: Array
    prior_std: Array

    @classmethod
    def of(cls, model: MomentumModel, settings: IdentifierSettings) -> Unknowns:
        """Unknowns that the identifier's settings ask for, with its prior."""
        head = 3 + model.n_aam
        momenta = np.full(model.n_aam, settings.momentum_prior_std)
        if settings.manifold == 'linear':
            largest = float(np.max(np.abs(model.prior()[head:])))
            inertia = np.full(model.size - head, settings.prior_std * largest)
            return cls(np.eye(model.size), np.concatenate([momenta, inertia]))
        bodies = BodyParameters(model.robot, settings.structure)
        jacobian = np.eye(model.size, head + bodies.size)
        values = partial(bodies.minimal_values, model)
        jacobian[head:, head:] = central_differences(values, np.zeros(bodies.size), _STEP)
        prior_std = np.concatenate([momenta, np.full(bodies.size, settings.prior_std)])
        return cls(jacobian, prior_std)

    def __len__(self) -> int:
        """Number m of unknowns, h_W left out."""
        return len(self.prior_std)

    @property
    def observable(self) -> int:
        """Number of directions that change the constants at all, h_W left out."""
        singular = np.linalg.svd(self.to_constants[3:, 3:] * self.prior_std, compute_uv=False)
        return int(np.sum(singular > _RANK_TOLERANCE * singular[0]))


class Information:
    """The measure for one robot and one set of sensors.

    Args:
        model: Robot as assumed, and minimal set.
        noise: Of the sensors. rates: How often they sample.
        unknowns: What is to be estimated, with its prior.
    """

    def __init__(
        self,
        model: MomentumModel,
        noise: NoiseLevels,
        rates: SimulatorSettings,
        unknowns: Unknowns,
    ) -> None:
        self._model, self._unknowns = model, unknowns
        # densities of continuous measurements with the information of the samples, per sqrt(Hz)
        self._gyro_noise = noise.gyro / np.sqrt(rates.imu_rate)
        self._attitude_noise = noise.attitude / np.sqrt(rates.attitude_rate)
        joint = 1.0 / np.hypot(1.0 / (_BAND * noise.joint_position), 1.0 / noise.joint_velocity)
        self._rate_noise = joint / np.sqrt(rates.joint_rate)

    def gain(self, motion: BaseMotion) -> Array:
        """(B,) bits that each candidate's measurement tells."""
        fisher = self.fisher(motion)
        sign, log = np.linalg.slogdet(np.eye(fisher.shape[-1]) + fisher)
        return np.where(sign > 0.0, 0.5 * log / np.log(2.0), -np.inf)

    def fisher(self, motion: BaseMotion) -> Array:
        """(B, m, m) information of the unknowns in units of the prior's std."""
        drive = motion.inverse @ (self.columns(motion) @ self._unknowns.to_constants)
        psi, rate = _sensitivities(motion, drive)
        weight = self._weights(motion)
        info = _gram(weight @ rate) + _gram(psi / self._attitude_noise)
        info *= motion.time[1] - motion.time[0]
        prior_std = self._unknowns.prior_std
        return _eliminate(info, 6) * np.outer(prior_std, prior_std)

    def columns(self, motion: BaseMotion) -> Array:
        """(B, T, 3, p) regressor of the momentum equation in base axes."""
        columns, _ = self._model.regressor(motion.kinematics)
        return columns.reshape(*motion.q.shape[:2], 3, -1)

    def _weights(self, motion: BaseMotion) -> Array:
        """(B, T, 3, 3) square roots of the inverse noise density of the base rate."""
        c = motion.coupling
        noise = self._rate_noise**2 * c @ np.swapaxes(c, -1, -2)
        noise = noise + self._gyro_noise**2 * np.eye(3)
        return np.linalg.inv(np.linalg.cholesky(noise))


def _sensitivities(motion: BaseMotion, drive: Array) -> tuple[Array, Array]:
    """(B, T, 3, 6 + m) psi and dw by [psi(0); h_W; y], by trapezoidal steps.

    Args:
        motion: Of B candidates.
        drive: (B, T, 3, 3 + m) of dw by [h_W; y].
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

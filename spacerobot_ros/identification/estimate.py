"""The result of an identification, for messages, JSON and reports alike."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..types import Array, Matrix3, Vector3


@dataclass(frozen=True, slots=True)
class NamedValue:
    """One estimated number with its standard deviation."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """Wheel momentum and minimal inertial parameters with their covariance.

    Args:
        method: How it was obtained: `online`, `ml`, `ls` or `recursive`.
        valid: Whether it may be used for control.
        reason: Why not valid; empty when valid.
        aam_links: Links that carry the unknown wheels.
        aam: (3 n_links,) wheel momentum, link after link, each in its link frame [N m s].
        parameter_names: Names of the k minimal parameters.
        parameters: (k,) minimal parameters [kg m^2].
        covariance: (3 n_links + k, same) of [aam; parameters].
        rank: Numerical rank of the unit-column information.
        condition: Condition number of the unit-column regressor.
        unexcited: Directions that the data do not tell, in words; empty at full rank.
        total_momentum: (3,) about the centre of mass, inertial frame [N m s].
        total_momentum_covariance: (3, 3).
        chi2_per_dof: Residual chi-square per degree of freedom; 1 where the noise is as stated.
        samples: Number of samples used.
        stamp_ns: Time of the last sample used [ns].
        notes: Remarks for the user.
        nuisances: Further unknowns that were estimated along, such as a gyro bias.
        weak: (m, 3 n_links + k) the unexcited directions as unit vectors; empty in an estimate
            that came as a message.
        unit: Of the parameters; empty where they are ratios.
    """

    method: str
    valid: bool
    reason: str
    aam_links: tuple[str, ...]
    aam: Array
    parameter_names: tuple[str, ...]
    parameters: Array
    covariance: Array
    rank: int
    condition: float
    unexcited: tuple[str, ...]
    total_momentum: Vector3
    total_momentum_covariance: Matrix3
    chi2_per_dof: float
    samples: int
    stamp_ns: int
    notes: tuple[str, ...] = field(default=())
    nuisances: tuple[NamedValue, ...] = field(default=())
    weak: Array = field(default_factory=lambda: np.zeros((0, 0)))
    unit: str = 'kg m^2'

    @property
    def unknowns(self) -> int:
        """Number of unknowns, wheel momentum and minimal parameters."""
        return len(self.aam) + len(self.parameters)

    @property
    def std(self) -> Array:
        """(3 n_links + k,) standard deviations of [aam; parameters]."""
        return np.sqrt(np.diag(self.covariance))

    def check(self) -> None:
        """Refuse an estimate that must not be used.

        Raises:
            IdentificationError: sizes that don't fit, non-finite numbers or a negative variance.
        """
        size = self.unknowns
        if len(self.aam) != 3 * len(self.aam_links) or len(self.parameters) != len(
            self.parameter_names
        ):
            raise IdentificationError('estimate: sizes of values and names do not fit')
        if self.covariance.shape != (size, size):
            raise IdentificationError(
                f'estimate: covariance is {self.covariance.shape}, expected {(size, size)}'
            )
        values = np.concatenate([self.aam, self.parameters, self.covariance.ravel()])
        if not np.all(np.isfinite(values)):
            raise IdentificationError('estimate: not finite')
        if np.any(np.diag(self.covariance) < 0.0):
            raise IdentificationError('estimate: negative variance')

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, as `spacerobot identify --json` prints it."""
        std = self.std
        n = len(self.aam)
        return {
            'aam': {
                'value': self.aam.tolist(),
                'std': std[:n].tolist(),
                'unit': 'N m s',
                'links': list(self.aam_links),
            },
            'parameters': [
                {'name': name, 'value': float(value), 'std': float(s), 'unit': self.unit}
                for name, value, s in zip(
                    self.parameter_names, self.parameters, std[n:], strict=True
                )
            ],
            'rank': self.rank,
            'unknowns': self.unknowns,
            'condition': self.condition,
            'unexcited': list(self.unexcited),
            'chi2_per_dof': self.chi2_per_dof,
            'method': self.method,
            'valid': self.valid,
            'reason': self.reason,
            'momentum': {
                'value': self.total_momentum.tolist(),
                'std': np.sqrt(np.diag(self.total_momentum_covariance)).tolist(),
                'unit': 'N m s',
                'frame': 'inertial',
            },
            'nuisances': [asdict(nuisance) for nuisance in self.nuisances],
            'samples': self.samples,
            'notes': list(self.notes),
        }


def estimated_values(model: MomentumModel, constants: Array, covariance: Array) -> dict[str, Any]:
    """The fields of an `Estimate` that constants (p,) and their covariance (p, p) make."""
    wanted = slice(3, model.x.stop)
    values, std = constants[model.other], np.sqrt(np.diag(covariance))[model.other]
    nuisances = zip(
        model.nuisances.names, values.tolist(), std.tolist(), model.nuisances.units, strict=True
    )
    return {
        'aam_links': tuple(g.link for g in model.robot.target_wheels),
        'aam': constants[model.aam],
        'parameter_names': model.minimal.names,
        'parameters': constants[model.x],
        'covariance': covariance[wanted, wanted],
        'total_momentum': constants[:3],
        'total_momentum_covariance': covariance[:3, :3],
        'nuisances': tuple(NamedValue(*each) for each in nuisances),
    }

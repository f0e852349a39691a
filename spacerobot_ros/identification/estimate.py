"""The result of an identification, for messages, JSON and reports alike."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ..errors import IdentificationError
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
        rank: Number of directions that the data tell better than the robot file does.
        unknowns: Number of unknowns: momenta, bodies and nuisances.
        condition: Square root of the condition number of the unknowns' correlations; of `ls` that
            of the unit-column regressor.
        unexcited: What only the robot file tells, in words, a few lines; of `ls` directions.
        total_momentum: (3,) about the centre of mass, inertial frame [N m s].
        total_momentum_covariance: (3, 3).
        chi2_per_dof: Residual chi-square per degree of freedom; 1 where the noise is as stated.
        samples: Number of samples used.
        stamp_ns: Time of the last sample used [ns].
        notes: Remarks for the user.
        nuisances: Further unknowns that were estimated along, such as a gyro bias.
        units: Of each parameter; empty texts where they are ratios.
        sources: (3 n_links + k) what each number is from: `data` (its variance shrank by more than
            nine tenths), `file` (by less than a tenth) or `both`.
        prior_factor: By which the data scale the uncertainties of the robot file's bodies; NaN
            where no prior took part.
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
    unknowns: int
    condition: float
    unexcited: tuple[str, ...]
    total_momentum: Vector3
    total_momentum_covariance: Matrix3
    chi2_per_dof: float
    samples: int
    stamp_ns: int
    notes: tuple[str, ...] = field(default=())
    nuisances: tuple[NamedValue, ...] = field(default=())
    units: tuple[str, ...] = field(default=())
    sources: tuple[str, ...] = field(default=())
    prior_factor: float = float('nan')

    @property
    def std(self) -> Array:
        """(3 n_links + k,) standard deviations of [aam; parameters]."""
        return np.sqrt(np.diag(self.covariance))

    def check(self) -> None:
        """Refuse an estimate that must not be used.

        Raises:
            IdentificationError: sizes that don't fit, non-finite numbers or a negative variance.
        """
        sizes = len(self.aam), len(self.parameters)
        if sizes != (3 * len(self.aam_links), len(self.parameter_names)):
            raise IdentificationError('estimate: sizes of values and names do not fit')
        shape, expected = self.covariance.shape, (sum(sizes), sum(sizes))
        if shape != expected:
            raise IdentificationError(f'estimate: covariance is {shape}, expected {expected}')
        values = np.concatenate([self.aam, self.parameters, self.covariance.ravel()])
        if not np.all(np.isfinite(values)):
            raise IdentificationError('estimate: not finite')
        if np.any(np.diag(self.covariance) < 0.0):
            raise IdentificationError('estimate: negative variance')

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON, as `spacerobot identify --json` prints it."""
        std, n = self.std, len(self.aam)
        sources = self.sources or (None,) * len(std)
        numbers = self.parameters.tolist(), std[n:].tolist()
        parameters = zip(self.parameter_names, *numbers, self.units, sources[n:], strict=True)
        return {
            'aam': {
                'value': self.aam.tolist(),
                'std': std[:n].tolist(),
                'unit': 'N m s',
                'links': list(self.aam_links),
                'source': list(sources[:n]),
            },
            'parameters': [
                {'name': name, 'value': value, 'std': s, 'unit': unit, 'source': source}
                for name, value, s, unit, source in parameters
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
            'prior_factor': self.prior_factor,
            'notes': list(self.notes),
        }

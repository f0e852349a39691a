"""The result of an identification, for messages, JSON and reports alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import IdentificationError
from ..json_values import json_as, json_fields, json_value
from ..types import Array, Matrix3, Vector3


@dataclass(frozen=True, slots=True)
class NamedValue:
    """One estimated number with its standard deviation."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
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
    aam_links: tuple[str, ...] = json_as()
    aam: Array
    parameter_names: tuple[str, ...] = json_as()
    parameters: Array
    covariance: Array = json_as()
    rank: int
    unknowns: int
    condition: float
    unexcited: tuple[str, ...]
    total_momentum: Vector3 = json_as('momentum')
    total_momentum_covariance: Matrix3 = json_as()
    chi2_per_dof: float
    samples: int
    stamp_ns: int = json_as()
    notes: tuple[str, ...] = ()
    nuisances: tuple[NamedValue, ...] = ()
    units: tuple[str, ...] = json_as(default=())
    sources: tuple[str, ...] = json_as(default=())
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
        momentum_std = np.sqrt(np.diag(self.total_momentum_covariance))
        names = ('name', 'value', 'std', 'unit', 'source')
        columns = (self.parameter_names, self.parameters, std[n:], self.units, sources[n:])
        values = json_fields(self) | {
            'aam': {
                'value': self.aam,
                'std': std[:n],
                'unit': 'N m s',
                'links': self.aam_links,
                'source': sources[:n],
            },
            'parameters': [
                dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)
            ],
            'momentum': {
                'value': self.total_momentum,
                'std': momentum_std,
                'unit': 'N m s',
                'frame': 'inertial',
            },
        }
        return dict(json_value(values))

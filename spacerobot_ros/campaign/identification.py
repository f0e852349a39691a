"""Minimal sets, condition numbers and identification without noise: Table III, first half."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.minimal import minimal_set
from ..types import Array
from .linear_system import LinearSystem, linear_system, relative_errors, true_solution
from .scenario import cached_motion, forward_motion, scenario


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFreeResult:
    """One robot, minimal set and start, without noise.

    Args:
        axes: Joint axes. structure: `symmetric` or `generic`. start: One of `scenario.STARTS`.
        k: Size of the minimal set.
        rank_gap: Smallest kept over largest dropped singular value.
        condition: Of A, raw and with unit columns.
        names: (3 + k,) names of the unknowns.
        momentum_error: (3 + k,) relative errors on momentum-integrated data [%]; NaN where zero.
        forward_error: (3 + k,) the same on forward-integrated data [%].
        wrong_model_error: (k,) with the captured wheels left out of the model [%].
    """

    axes: str
    structure: str
    start: str
    k: int
    rank_gap: float
    condition: tuple[float, float]
    names: tuple[str, ...]
    momentum_error: Array
    forward_error: Array
    wrong_model_error: Array

    @property
    def worst(self) -> tuple[float, float]:
        """Largest relative error on momentum- and on forward-integrated data [%]."""
        return largest(self.momentum_error), largest(self.forward_error)


def noise_free(
    axes: str, start: str, structures: tuple[str, ...] = ('symmetric',)
) -> list[NoiseFreeResult]:
    """Identify from noise-free data of both kinds; the integration serves all structures."""
    case = scenario(axes)
    motions = (cached_motion(axes, start), forward_motion(case, start))
    out = []
    for structure in structures:
        minimal = minimal_set(case.robot, structure)
        truth = true_solution(case.robot, minimal)
        exact, forward = (linear_system(case.robot, minimal, m, start) for m in motions)
        out.append(
            NoiseFreeResult(
                axes=axes,
                structure=structure,
                start=start,
                k=len(minimal),
                rank_gap=minimal.rank_gap,
                condition=exact.condition,
                names=('h_x', 'h_y', 'h_z', *minimal.names),
                momentum_error=_errors(exact, truth),
                forward_error=_errors(forward, truth),
                wrong_model_error=_errors(exact.without_aam(), truth[3:]),
            )
        )
    return out


def largest(errors: Array) -> float:
    """Largest magnitude, zero parameters left out."""
    return float(np.nanmax(np.abs(errors)))


def _errors(system: LinearSystem, truth: Array) -> Array:
    return relative_errors(system.solve(), truth)

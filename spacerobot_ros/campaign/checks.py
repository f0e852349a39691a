"""The results of the reproduction held against the figures that are to be reached."""

from __future__ import annotations

from typing import NamedTuple

from . import paper
from .identification import NoiseFreeResult
from .tracking import TrackingRun
from .wheel_momentum import Reproduction


class Check(NamedTuple):
    """A figure to reach.

    Args:
        what: The figure.
        value: Reached.
        low: Smallest good value. high: Largest good value.
        unit: Of them.
    """

    what: str
    value: float
    low: float
    high: float
    unit: str = ''

    @property
    def is_met(self) -> bool:
        """Whether the value is within its limits."""
        return self.low <= self.value <= self.high


def checks(results: Reproduction) -> list[Check]:
    """All figures to reach that were computed."""
    out = [check for result in results.noise_free for check in _noise_free_checks(result)]
    out += [check for r in results.tracking for check in _tracking_checks(r)]
    for s in results.scores:
        if s.method in ('ml', 'online'):
            # the scatter of a root mean square over few runs of one, common error
            limit = (1.15 if s.method == 'ml' else 1.3) + 2.0 / (2.0 * s.runs) ** 0.5
            name = f'RMSE / bound of the AAM, {s.method}, {s.axes}, noise x {s.scale:g}'
            out.append(Check(name, s.aam_over_bound, 0.0, limit))
    return out


def _noise_free_checks(result: NoiseFreeResult) -> list[Check]:
    name = f'{result.axes} {result.structure} {result.start}'
    exact, forward = result.worst
    out = [Check(f'largest error without noise, {name}', exact, 0.0, 1e-10, '%')]
    out.append(Check(f'the same, forward-integrated, {name}', forward, 0.0, 5e-9, '%'))
    reference = paper.CONDITION_REFERENCE.get((result.axes, result.structure))
    if reference is None or result.start != 'moving':
        return out
    out.append(Check(f'minimal set, {name}', result.k, reference.k, reference.k))
    value = reference.moving[0]
    out.append(Check(f'condition, {name}', result.condition[0], 0.99 * value, 1.01 * value))
    return out


def _tracking_checks(result: TrackingRun) -> list[Check]:
    key = (result.axes, result.plant, result.law, result.bandwidth)
    name = f'largest joint error, {result.axes}, {result.law}, {result.plant} plant, '
    name += f'{result.bandwidth:g} rad/s'
    error = result.max_joint_error_deg
    if result.law == 'corrected':
        return [Check(name, error, 0.0, 1e-6, 'deg')]
    if key in paper.TRACKING_REFERENCE and result.bandwidth == 1.0:
        value = paper.TRACKING_REFERENCE[key][0]
        return [Check(name, error, 0.95 * value, 1.05 * value, 'deg')]
    return []

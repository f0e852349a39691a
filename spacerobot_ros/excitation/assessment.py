"""Everything that a user is told of a design: one object for tables, JSON and report.

Own wheels are a design lever: their known momentum fixes the common scale of the estimate. The
momentum equation A x = b is nearly homogeneous: the right-hand side is the momentum of the
servicer's own wheels alone. Without it only ratios can be told; the faster they spin, the better
the scale.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..dynamics.equations import Dynamics, without_translation
from ..types import Array
from .design import Design
from .precision import REST, Prediction, predict_design, predict_reference, predict_with_wheels
from .problem import Problem

_FACTORS = (1.0, 2.0, 5.0)  # on the momentum of the own wheels
_TRIED = 5e-3  # rad/s at which momentum turns the robot, where the file has the wheels at rest
_WORTH = 0.9  # of the std; a smaller gain is not worth a spin-up
_POOR = 0.02  # of |h|; predictions worse than this are of little use
_BLIND = 0.1  # rad/s


@dataclass(frozen=True, slots=True, eq=False)
class WheelOption:
    """The same joint motion with other wheel momentum.

    Args:
        factor: On the momentum of the robot file; where that is zero on one that turns the robot
            at 5 mrad/s about each axis.
        momentum: (3,) in base_link [N m s].
        prediction: What it reaches.
    """

    factor: float
    momentum: Array
    prediction: Prediction

    @property
    def allowed(self) -> bool:
        """Whether every limit holds."""
        return self.prediction.hardest_use.fraction <= 1.0

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        names = ('factor', 'momentum', 'allowed', 'prediction')
        return {name: getattr(self, name) for name in names}


class Summary:
    """A design and what it is worth.

    Args:
        problem: What was to be designed. found: The result of the search.

    Attributes:
        uses: How the motion uses every limit, off-nominal wheel momenta included.
        design: Prediction for the motion. reference: For the robot file's own, if it has one.
        with_rest: For a spin-up with a measured rest before it.
        wheels: The same motion with other momentum of the own wheels. advice: On them.
        notes: Remarks.
    """

    def __init__(self, problem: Problem, found: Design) -> None:
        x, h0 = found.x, problem.robot.servicer_wheels.momentum
        if not h0.any():
            h0 = np.full(3, _TRIED * _moment(problem))
        self.problem, self.found, self.uses = problem, found, problem.uses(x)
        self.design, self.reference = predict_design(problem, x), predict_reference(problem)
        is_spun_up = problem.start_kind == 'spin_up'
        self.with_rest = predict_design(problem, x, with_rest=True) if is_spun_up else None
        self.wheels = [
            WheelOption(factor, factor * h0, predict_with_wheels(problem, x, factor * h0))
            for factor in _FACTORS
        ]
        self.advice = _advice(problem, self.wheels)
        self.notes = list(_notes(problem, self.design, self.reference))

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        problem = self.problem
        identifier = problem.settings.identifier
        return {
            'schema': 1,
            'robot': problem.robot.name,
            'criterion': problem.settings.excitation.criterion,
            'structure': identifier.structure,
            'manifold': identifier.manifold,
            'start': {'kind': problem.start_kind, 'angular_velocity': problem.start.omega},
            'attempts': [a._asdict() for a in self.found.attempts],
            'interrupted': self.found.interrupted,
            'limits': [{**u._asdict(), 'margin': 1.0 - u.fraction} for u in self.uses],
            'design': self.design,
            'reference': self.reference,
            'with_rest': self.with_rest,
            'own_wheels': self.wheels,
            'advice': self.advice,
            'notes': self.notes,
        }


def _moment(problem: Problem) -> float:
    """Mean moment of inertia of the whole about its centre of mass, at the start [kg m^2]."""
    M = Dynamics(problem.robot).mass_matrix(problem.family.start)
    return float(np.trace(without_translation(M)[:3, :3])) / 3.0


def _advice(problem: Problem, options: Sequence[WheelOption]) -> str:
    """One sentence on the own wheels."""
    if not problem.robot.servicer_wheels.momentum.any():
        return (
            "the servicer's wheels are at rest: the common scale of all estimates is unknown and "
            'only ratios can be told; spin the wheels up first'
        )
    allowed = [o for o in options if o.allowed]
    if not allowed:
        return 'the limits hold at no multiple of the present wheel momentum'
    best = max(allowed, key=lambda o: o.prediction.bits)
    now = options[0]
    if best is now or best.prediction.scale_std > _WORTH * now.prediction.scale_std:
        broken = next((o for o in options[1:] if not o.allowed), None)
        why = ''
        if broken is not None:
            use = broken.prediction.hardest_use
            why = f': {use.name} of {use.where} beyond its limit at x{broken.factor:g}'
        return f'keep the present wheel momentum{why}; a search at a higher one may still pay'
    gain = now.prediction.scale_std / best.prediction.scale_std
    return (
        f'spin the wheels up to x{best.factor:g} '
        f'({np.linalg.norm(best.momentum):.4g} N m s) before identifying: the common scale gets '
        f'{gain:.2g} times better known, the whole estimate '
        f'{best.prediction.bits - now.prediction.bits:.1f} bits'
    )


def _notes(
    problem: Problem, prediction: Prediction, reference: Prediction | None
) -> Iterator[str]:
    settings = problem.settings
    options, momentum = settings.excitation, problem.robot.target_momentum
    if len(momentum):
        stated = settings.truth.target_momentum or settings.truth.target_rates
        source = 'truth of the robot file' if stated else 'belief of the robot file'
        yield (
            f'designed for wheel momentum [{", ".join(f"{h:.4g}" for h in momentum)}] N m s of '
            f'the captured body ({source}), each axis +- {options.momentum_uncertainty:g}'
        )
    if options.start == 'auto' and problem.start_kind == 'rest':
        rate = float(np.linalg.norm(settings.initial.angular_velocity))
        yield (
            f'starts with the base at rest: at the initial rate of {rate:.3g} rad/s in the robot '
            'file the limits leave no room; bring the base to rest first'
        )
    if problem.start_kind == 'spin_up':
        yield (
            'starts from rest with the own wheels just spun up; `with rest` also counts '
            f'{REST:g} s of rest measured before the spin-up, own wheels still'
        )
    fastest = max(use.value for use in prediction.uses if use.name == 'base_rate')
    if fastest > _BLIND:
        yield (
            f'the base turns at up to {fastest:.2g} rad/s: many star trackers are blind above '
            f'{_BLIND:g} rad/s; excitation.base_rate limits it'
        )
    if reference is not None and (use := reference.hardest_use).fraction > 1.0:
        yield (
            f"the file's own motion does not keep these limits: {use.name} of {use.where} reaches "
            f'{use.value:.3g} {use.unit} (limit {use.limit:.3g})'
        )
    if problem.unstated:
        yield (f'typical sensor noise assumed for {", ".join(problem.unstated)}')
    if prediction.told < prediction.tellable:
        yield (
            f'{prediction.tellable - prediction.told} of {prediction.tellable} '
            f'directions of the '
            f'{settings.identifier.manifold} set are hardly told better by this motion than by '
            'the prior'
        )
    if prediction.worst_aam > _POOR:
        yield ('the wheel momentum is told poorly: allow more motion or a longer one')

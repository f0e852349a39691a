"""Everything that a user is told of a design: one object for tables, JSON and report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .design import Attempt, Design
from .limits import Use
from .own_wheels import WheelOption, recommendation, wheel_options
from .prediction import REST, Prediction, predict_design, predict_reference
from .problem import Problem

_POOR = 0.02  # of |h|; predictions worse than this are of little use
_BLIND = 0.1  # rad/s


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """A design and what it is worth.

    Args:
        robot: Name of the robot. criterion: What was optimised. structure, manifold: Of the
            identifier.
        start: How the base starts. omega: (3,) its rate [rad/s].
        attempts: What every starting point led to. interrupted: Whether Ctrl-C ended the search.
        uses: How the motion uses every limit, off-nominal wheel momenta included.
        design: Prediction for the motion. reference: For the robot file's own, if it has one.
        with_rest: For a spin-up with a measured rest before it.
        wheels: The same motion with other momentum of the own wheels. advice: On them.
        notes: Remarks.
    """

    robot: str
    criterion: str
    structure: str
    manifold: str
    start: str
    omega: tuple[float, ...]
    attempts: tuple[Attempt, ...]
    interrupted: bool
    uses: tuple[Use, ...]
    design: Prediction
    reference: Prediction | None
    with_rest: Prediction | None
    wheels: tuple[WheelOption, ...]
    advice: str
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON; what is not finite becomes null."""
        data = {
            'schema': 1,
            'robot': self.robot,
            'criterion': self.criterion,
            'structure': self.structure,
            'manifold': self.manifold,
            'start': {'kind': self.start, 'angular_velocity': list(self.omega)},
            'attempts': [asdict(a) for a in self.attempts],
            'interrupted': self.interrupted,
            'limits': [{**asdict(u), 'margin': 1.0 - u.fraction} for u in self.uses],
            'design': _prediction(self.design),
            'reference': self.reference and _prediction(self.reference),
            'with_rest': self.with_rest and _prediction(self.with_rest),
            'own_wheels': [
                {
                    'factor': o.factor,
                    'momentum': o.momentum.tolist(),
                    'allowed': o.allowed,
                    'prediction': _prediction(o.prediction),
                }
                for o in self.wheels
            ],
            'advice': self.advice,
            'notes': list(self.notes),
        }
        plain: dict[str, Any] = _finite(data)
        return plain


def summarise(problem: Problem, design: Design) -> Summary:
    """Assess a design."""
    settings = problem.settings
    options = wheel_options(problem, design.x)
    spun_up = problem.start_kind == 'spin_up'
    prediction, reference = predict_design(problem, design.x), predict_reference(problem)
    return Summary(
        robot=problem.robot.name,
        criterion=settings.excitation.criterion,
        structure=settings.identifier.structure,
        manifold=settings.identifier.manifold,
        start=problem.start_kind,
        omega=tuple(problem.start.omega.tolist()),
        attempts=design.attempts,
        interrupted=design.interrupted,
        uses=_worst_uses(problem, design),
        design=prediction,
        reference=reference,
        with_rest=predict_design(problem, design.x, with_rest=True) if spun_up else None,
        wheels=options,
        advice=recommendation(problem, options),
        notes=tuple(_notes(problem, prediction, reference)),
    )


def _worst_uses(problem: Problem, design: Design) -> tuple[Use, ...]:
    """Of every limit the hardest use among the assumed wheel momenta, on the fine grid."""
    motions = problem.all_motions(design.x)
    every = zip(*(problem.limits.uses(motion) for motion in motions), strict=True)
    return tuple(max(same, key=lambda use: (use.fraction, abs(use.value))) for same in every)


def _notes(problem: Problem, prediction: Prediction, reference: Prediction | None) -> list[str]:
    settings = problem.settings
    options, momentum = settings.excitation, problem.robot.target_momentum
    notes = []
    if len(momentum):
        stated = settings.truth.target_momentum or settings.truth.target_rates
        source = 'truth of the robot file' if stated else 'belief of the robot file'
        notes.append(
            f'designed for wheel momentum [{", ".join(f"{h:.4g}" for h in momentum)}] N m s of '
            f'the captured body ({source}), each axis +- {options.momentum_uncertainty:g}'
        )
    if options.start == 'auto' and problem.start_kind == 'rest':
        rate = float(np.linalg.norm(settings.initial.angular_velocity))
        notes.append(
            f'starts with the base at rest: at the initial rate of {rate:.3g} rad/s in the robot '
            'file the limits leave no room; bring the base to rest first'
        )
    if problem.start_kind == 'spin_up':
        notes.append(
            'starts from rest with the own wheels just spun up; `with rest` also counts '
            f'{REST:g} s of rest measured before the spin-up, own wheels still'
        )
    fastest = max(use.value for use in prediction.uses if use.name == 'base_rate')
    if fastest > _BLIND:
        notes.append(
            f'the base turns at up to {fastest:.2g} rad/s: many star trackers are blind above '
            f'{_BLIND:g} rad/s; excitation.base_rate limits it'
        )
    if reference is not None and (broken := [u for u in reference.uses if u.fraction > 1.0]):
        use = max(broken, key=lambda u: u.fraction)
        notes.append(
            f"the file's own motion does not keep these limits: {use.name} of {use.where} reaches "
            f'{use.value:.3g} {use.unit} (limit {use.limit:.3g})'
        )
    if problem.unstated:
        notes.append(f'typical sensor noise assumed for {", ".join(problem.unstated)}')
    if prediction.told < prediction.tellable:
        notes.append(
            f'{prediction.tellable - prediction.told} of {prediction.tellable} directions of the '
            f'{settings.identifier.manifold} set are hardly told better by this motion than by '
            'the prior'
        )
    if prediction.worst_aam > _POOR:
        notes.append('the wheel momentum is told poorly: allow more motion or a longer one')
    return notes


def _prediction(prediction: Prediction) -> dict[str, Any]:
    return {
        'bits': prediction.bits,
        'told': prediction.told,
        'tellable': prediction.tellable,
        'condition': prediction.condition,
        'unit_condition': prediction.unit_condition,
        'scale_std': prediction.scale_std,
        'worst_aam': prediction.worst_aam,
        'median_parameter': prediction.median_parameter,
        'worst_parameter': prediction.worst_parameter,
        'names': list(prediction.names),
        'values': prediction.values.tolist(),
        'std': prediction.std.tolist(),
        'relative_std': prediction.relative.tolist(),
    }


def _finite(value: Any) -> Any:
    """JSON has no infinity and no NaN."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

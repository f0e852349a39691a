"""A body without joints: what its own turning tells of its inertia.

Without a known torque or momentum, J w' + w x J w = 0 holds for J of any scale: the ratios

    J / J_xx,    five numbers, of which two are ratios of principal moments and three their axes,

are all there is. They are fitted as the effect `inertial_parameters` is by the diagnosis, the
measured attitude and rates predicted from one initial state.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects.bodies.bodies import InertialParameters
from ..effects.effect import Effect
from ..estimation.fit import Fit
from ..estimation.noise_levels import noise_levels
from ..estimation.refit import refine
from ..estimation.runs import Run
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .summary import Identification, unexplained
from .validity_limits import LARGEST_CHI2, WEAKLY_KNOWN

_RATIOS = ('Jyy/Jxx', 'Jzz/Jxx', 'Jxy/Jxx', 'Jxz/Jxx', 'Jyz/Jxx')
_PLACES = ((1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_STEP = 1e-6  # of a parameter's plausible size, for the ratios' derivatives


def identify_lone_body(record: Record, robot: Robot, believed: Sequence[Effect]) -> Identification:
    """Ratios of inertia about the centre of mass, with covariance.

    Args:
        record: Gyro, attitude or both.
        robot: The robot file's, without joints.
        believed: Its own effects.

    Returns:
        An estimate whose parameters are the ratios, and the robot that has them.
    """
    noise, notes = noise_levels(robot.sensors, record, is_checked=False)
    base = robot.base_link
    start = InertialParameters(name='body', where=base, values=InertialParameters.nominal())
    fit = refine(Run(record, robot, believed, noise), [start])
    found, free = fit.rows.robot, [p for _, p in fit.free]
    sizes, (known, *_) = np.array([p.size for p in free]), fit.standard_deviations()
    slopes = _slopes(fit, _STEP * sizes)
    stds = np.array([known[p.name] for p in free])
    unexcited = tuple(p.name for p in free if known[p.name] * WEAKLY_KNOWN > p.size)
    chi2 = float(fit.data @ fit.data) / max(len(fit.data) - len(fit.free), 1)
    reason = f'{len(unexcited)} of {len(stds)} directions are not excited yet' * bool(unexcited)
    if chi2 > LARGEST_CHI2:
        reason = unexplained(chi2)
    moments, axes = np.linalg.eigh(found.bodies[0].inertia)
    estimate = Estimate(
        method='ml',
        valid=not reason,
        reason=reason,
        aam_links=(),
        aam=np.zeros(0),
        parameter_names=_RATIOS,
        parameters=_ratios(found),
        covariance=slopes @ fit.covariance() @ slopes.T,
        rank=max(0, len(_RATIOS) - len(unexcited)),
        condition=float(np.linalg.cond(fit.tangents * sizes)),
        unexcited=unexcited,
        total_momentum=np.full(3, np.nan),
        total_momentum_covariance=np.full((3, 3), np.nan),
        chi2_per_dof=chi2,
        samples=len(record.joint_time),
        stamp_ns=record.origin_ns + round(record.span[1] * 1e9),
        notes=(*record.notes, *notes, *_scale(found), _in_words(moments, axes)),
        units=('',) * len(_RATIOS),
        unknowns=len(_RATIOS),
        sources=('data',) * len(_RATIOS),
    )
    return Identification(estimate, found)


def _ratios(robot: Robot) -> Array:
    """(5,) of the base's inertia about its centre of mass."""
    inertia = robot.bodies[0].inertia
    return np.array([inertia[i, j] / inertia[0, 0] for i, j in _PLACES])


def _slopes(fit: Fit, steps: Array) -> Array:
    """(5, P) derivatives of the ratios by the fitted numbers, by steps (P,) of them."""
    moved = [fit.moved(change)[0].change(fit.run.robot) for change in np.diag(steps)]
    ratios = np.stack([_ratios(robot) for robot in moved], axis=1)
    return (ratios - _ratios(fit.rows.robot)[:, None]) / steps


def _scale(robot: Robot) -> tuple[str, ...]:
    """That the inertia's scale is not known, or what it is by known torques."""
    if InertialParameters.parameters_at(robot, robot.base_link)[0].name in ('ixy', 'ixz'):
        why = 'no torque on the body and no momentum of wheels is known'
        return (f'{why}: its inertia is known but for its scale',)
    return (f'Jxx {robot.bodies[0].inertia[0, 0]:.5g} kg m^2 by known torques or wheels',)


def _in_words(moments: Array, axes: Array) -> str:
    """Principal moments in their ratio and how far each principal axis lies off the base's."""
    ratio = ' : '.join(f'{m / moments[0]:.5g}' for m in moments)
    tilts = [
        f'{np.degrees(np.arccos(min(1.0, np.max(np.abs(axis))))):.3g} deg off '
        f'{"xyz"[int(np.argmax(np.abs(axis)))]}'
        for axis in axes.T
    ]
    return f'principal moments {ratio}, their axes {", ".join(tilts)}'

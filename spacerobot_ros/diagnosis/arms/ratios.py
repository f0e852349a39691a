"""Ratios of a machine whose torques nobody measured: what holds for any scale of them.

Of a joint with inertia H about its own axis (all joints at zero): weight, frictions, the inertia
coupling with other joints and the motor constant by H; frictions by the motor constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ...dynamics.equations import Dynamics, joint_torques
from ...effects.catalogue import changed_robot
from ...effects.effect import Effect
from ...estimation.balance.arm_priors import DRY, VISCOUS, friction_of
from ...model.robot import Robot
from ...types import Array
from ..answer.result import Ratio
from .arm_found import ArmFound

_STEP = 1e-4  # rad, of the weight's slope
_ROUNDING = 1e-9  # of a coupling of two joints' inertias
_NUDGE = 1e-6  # of a coefficient's plausible size, of differences by it
_UNITS = {
    'weight_by_inertia': '1/s^2',
    'coulomb_by_inertia': 'rad/s^2',
    'viscous_by_inertia': '1/s',
    'inertia_by_inertia': '',
    'motor_constant_by_inertia': 'rad/s^2/A',
    'coulomb_by_motor_constant': 'A',
    'viscous_by_motor_constant': 'A s/rad',
}
_FRICTIONS = {'coulomb': DRY, 'viscous': VISCOUS}
RatioKey = tuple[str, str, str | None]  # joint, ratio, the other joint


def scale_notes(found: ArmFound) -> tuple[str, ...]:
    """What is missing where nothing says how large all torques are."""
    rows = found.fit.rows
    if found.robot.anchor != 'none' or not rows.unanchored:
        return ()
    joints = ', '.join(rows.robot.joints[j] for branch in rows.unanchored for j in branch)
    constants = 'robot.motor_constant, or ' if found.constants else ''
    return (
        f'no torque of {joints} is measured and nothing anchors them: N m, kg and N m/A are of '
        f"the file's scale, only ratios are known; to know more state {constants}"
        'robot.scale.anchor (gravity or inertia: what of the file is right)',
    )


def ratios(found: ArmFound) -> tuple[Ratio, ...]:
    """Of every joint on a branch of the machine without a measured torque.

    Args:
        found: What the search says.
    """
    rows, fit = found.fit.rows, found.fit
    joints = [rows.robot.joints[j] for branch in rows.unanchored for j in branch]
    if not joints:
        return ()
    gains = {
        str(c.where): at[0]
        for c, at in zip(rows.candidates, rows.places, strict=True)
        if c.kind.id == 'joint_torque_constant'
    }
    every = [i for i in (*fit.chosen, *fit.calibration) if not fit.is_gain(i)]
    which = [i for i in every if rows.candidates[i].recordings is None]

    def at(change: Array) -> dict[RatioKey, float]:
        """Ratios where coefficients (K,) are that much larger than found."""
        values = fit.values + change
        effects = [
            rows.candidates[i].applied(rows.candidates[i].values(fit.lasting(i, values)))
            for i in which
        ]
        constants = {
            str(e.where): e['constant'] / (1.0 - change[gains[str(e.where)]])
            for e in found.constants
        }
        return dict(_ratios(found.robot, [*found.believed, *effects], constants, joints))

    own = at(np.zeros(len(fit.values)))
    columns = [*(k for i in which for k in rows.places[i]), *(gains[e] for e in _places(found))]
    slopes: dict[RatioKey, Array] = {key: np.zeros(len(columns)) for key in own}
    for n, k in enumerate(columns):
        step = _NUDGE * float(rows.sizes[k])
        moved = at(step * np.eye(len(fit.values))[k])
        for key, value in own.items():
            slopes[key][n] = (moved.get(key, value) - value) / step
    covariance = fit.covariance(np.array(columns, dtype=int))
    return tuple(
        Ratio(
            joint=joint,
            ratio=ratio,
            of=of,
            value=value,
            std=math.sqrt(max(float(slope @ covariance @ slope), 0.0)) or math.nan,
            unit=_unit(found.robot, joint, ratio, of),
        )
        for ((joint, ratio, of), value), slope in zip(own.items(), slopes.values(), strict=True)
    )


def _unit(robot: Robot, joint: str, ratio: str, of: str | None) -> str:
    if of is None:
        return robot.unit_of(_UNITS[ratio], joint)
    # a coupling is in kg m^2, kg m or kg, by which of its two joints slide
    ways = robot.unit_of('rad', joint), robot.unit_of('rad', of)
    return {('m', 'rad'): 'm', ('rad', 'm'): '1/m'}.get(ways, '')


def _places(found: ArmFound) -> list[str]:
    return [str(effect.where) for effect in found.constants]


def _ratios(
    robot: Robot, effects: Sequence[Effect], constants: Mapping[str, float], joints: Sequence[str]
) -> Iterator[tuple[RatioKey, float]]:
    """Every ratio that is not zero."""
    changed = changed_robot(robot, effects)
    n = changed.n_joints
    inertia = Dynamics(changed).mass_matrix(np.zeros(n))[-n:, -n:]
    weight = _weight_slope(changed)
    for joint in joints:
        j = changed.joints.index(joint)
        own = float(inertia[j, j])
        named = {'weight_by_inertia': weight[j] / own}
        for what, law in _FRICTIONS.items():
            size = friction_of(effects, law, joint)
            named[f'{what}_by_inertia'] = size / own
            if joint in constants:
                named[f'{what}_by_motor_constant'] = size / constants[joint]
        if joint in constants:
            named['motor_constant_by_inertia'] = constants[joint] / own
        yield from (((joint, name, None), float(value)) for name, value in named.items() if value)
        for k, other in enumerate(changed.joints):
            if k != j and abs(inertia[j, k]) > _ROUNDING * math.sqrt(own * float(inertia[k, k])):
                yield (joint, 'inertia_by_inertia', other), float(inertia[j, k]) / own


def _weight_slope(robot: Robot) -> Array:
    """(n,) slope of each joint's own weight torque by its angle, all joints at zero [N m/rad]."""
    n = robot.n_joints
    rest = np.zeros((n, n))
    ends = [
        joint_torques(robot, sign * _STEP * np.eye(n), rest, rest, np.zeros((n, 3)))
        for sign in (1.0, -1.0)
    ]
    return np.asarray(np.diag(ends[0] - ends[1]) / (2.0 * _STEP))

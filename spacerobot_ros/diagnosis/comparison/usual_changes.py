"""What a machine that nobody touched changes by from one recording to the next."""

from __future__ import annotations

import math

import numpy as np

from ...effects.prior import BY_DIRECTION, NOTHING
from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_fit import Posterior
from ...estimation.balance.arm_priors import FRICTION, OF_LOAD
from ...estimation.balance.arm_rows import ArmRows
from ...types import Array
from .changes import is_lasting

_SHARE = {
    'inertial_parameters': 0.04,
    'joint_torque_constant': 0.05,
    'motor_inertia': 0.01,
    'effort_delay': 0.3,
    'encoder_offset': 0.02,
    'gravity_error': 0.02,
    'joint_stiffness': 0.02,
    'torque_sensor_bias': 0.025,
    'current_offset': 0.025,
}
"""Of a plausible size: next to nothing of what is a body's or a place's; of the torque, its scale
and its zero alike, 0.75 %."""
_USUAL = 0.1  # of a plausible size, of any other cause
_FRICTION = 0.1
"""Of the friction that is there: warm-up changes it by some percent (docs/real_machines.md). Of a
plausible size, which is all of a joint's torque, it was 9 N m where the weight of an arm is borne
by a joint that rubs with 0.3 N m."""
_LAWS = (*FRICTION, OF_LOAD)


def usual_changes(rows: ArmRows, found: Posterior) -> Array:
    """(K,) standard deviations of changes of every candidate's coefficients.

    Args:
        rows: Of both groups of recordings.
        found: Of the coefficients before: a change does not widen what it has to exceed.
    """
    friction, last = _friction(rows, found), rows.robot.last_links
    out = []
    for i, c in enumerate(rows.candidates):
        if c.where in last or not is_lasting(c):  # a payload does not change by itself
            out.append(NOTHING * c.sizes)
            continue
        usual = _SHARE.get(c.kind.id, _USUAL) * c.sizes
        if c.where in rows.robot.joints:
            j = rows.robot.joints.index(str(c.where))
            usual = _of_joint(rows, i, j, float(friction[j]), usual)
        out.append(np.maximum(usual, NOTHING * c.sizes))
    return np.concatenate(out)


def _of_joint(rows: ArmRows, i: int, j: int, friction: float, usual: Array) -> Array:
    """(k,) of a candidate at a joint, of which a friction is known [N m]."""
    kind, columns = rows.candidates[i].kind.id, rows.joints[j].columns[:, rows.places[i]]
    if not len(columns):
        return usual
    rubbing = friction / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    if kind in ZEROS:
        return np.hypot(usual, BY_DIRECTION * rubbing)
    return np.minimum(usual, _FRICTION * rubbing) if kind in _LAWS else usual


def _friction(rows: ArmRows, found: Posterior) -> Array:
    """(n,) rms torque of friction of all laws together, and what is uncertain in it [N m].

    Laws of neighbours among them: each alone is hardly told from others, their sum is.
    """
    pairs = zip(rows.candidates, rows.places, strict=True)
    at = np.concatenate([place for c, place in pairs if c.kind.id in _LAWS])
    root = np.linalg.cholesky(found.covariance[np.ix_(at, at)])
    out = rows.friction.copy()
    for j, own in enumerate(rows.joints[: len(out)]):
        if len(own.torque):
            columns = own.columns[:, at]
            power = (columns @ found.mean[at]) ** 2 + np.sum((columns @ root) ** 2, axis=1)
            out[j] = math.hypot(out[j], math.sqrt(float(np.mean(power))))
    return out

"""The friction of a joint as one law: what all its named frictions are together."""

from __future__ import annotations

import numpy as np

from ...effects.believed_friction import of_urdf
from ...effects.effect import Effect
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.balance.arm_priors import COUPLED
from ...estimation.balance.balance import Balance
from ...types import Array
from ..answer.result import FrictionLaw
from .arm_found import ArmFound
from .spring_rest import OFFSET, SPRING
from .two_directions import is_frictions

_ROUNDING = 1e-9  # share of a joint's friction: a line through one of its two columns


def friction_laws(found: ArmFound) -> tuple[FrictionLaw, ...]:
    """Coulomb and viscous friction that come closest to each joint's, over its rates.

    Least squares of the torques of all named frictions, of learned ones, of the URDF's and of what
    is applied beside them without a name (shapes share one torque), on [sign(q'), q'], where the
    joint moves; that of a motor which two joints turn is of neither alone, and is named with its
    values; friction with a history as it is once the joint slides, and friction of the load as it
    is under the torques of the extended model. A Coulomb torque beside friction that goes with the
    load, or beside a law that takes a share of it, is not what a textbook calls one.
    """
    laws = []
    for joint in found.robot.arm:
        effects = [e for e in found.named if _is_own(e, joint)]
        effects += [e for e in found.learned if _is_friction(e, joint)]
        if effects:
            beside = (*found.calibration, *of_urdf(found.extended[0].effects))
            effects += [e for e in beside if _is_own(e, joint)]
            rates, torques = zip(
                *(_friction(balance, effects, joint) for balance in found.extended),
                strict=True,
            )
            rate = np.concatenate(rates)
            design = np.column_stack([np.sign(rate), rate])
            torque = -np.concatenate(torques)
            coulomb, viscous = _rounded(np.linalg.lstsq(design, torque)[0], design).tolist()
            offset = _offset(found, joint, coulomb)
            law = FrictionLaw(
                joint=joint,
                unit=found.robot.unit_of('N m', joint),
                viscous_unit=found.robot.unit_of('N m s/rad', joint),
                coulomb=coulomb,
                viscous=viscous,
                coulomb_forward=coulomb + offset,
                coulomb_backward=coulomb - offset,
            )
            laws.append(law)
    return tuple(laws)


def _rounded(coefficients: Array, design: Array) -> Array:
    """(2,) coefficients without those that rounding makes, beside the largest of their torques."""
    torques = np.abs(coefficients) * np.sqrt(np.mean(design**2, axis=0))
    return np.where(torques > _ROUNDING * np.max(torques), coefficients, 0.0)


def _is_own(effect: Effect, joint: str) -> bool:
    """Whether it is friction of a joint alone."""
    is_friction = effect.id.endswith(('_friction', '_curvature'))
    return effect.where == joint and is_friction and effect.id != COUPLED


def _is_friction(law: Effect, joint: str) -> bool:
    """Whether a learned law is of the rate of the joint at which it acts."""
    if law.where != joint or not isinstance(law, LearnedTorque) or law.guard.react:
        return False
    return 'rate' in law.formula.quantities


def _offset(found: ArmFound, joint: str, coulomb: float) -> float:
    """Of a joint's measured torque, where one is named that may be its friction's [N m].

    Beside a spring it is its rest's.
    """
    own = {e.id: e for e in found.named if e.where == joint and e.recordings is None}
    if SPRING in own or OFFSET not in own:
        return 0.0
    bias = own[OFFSET]['bias']
    return bias if is_frictions(bias, coulomb) else 0.0


def _friction(balance: Balance, effects: list[Effect], joint: str) -> tuple[Array, Array]:
    """(M,) rates of a joint where it moves, and (M,) torques of its frictions."""
    motion, column = balance.motion, balance.robot.joints.index(joint)
    moving = balance.arm.is_moving[:, column]
    slides = np.sign(motion.qd[:, [column]])
    total = sum(
        e.force(motion, slides if e.hidden else e.driven(motion))[:, 6 + column] for e in effects
    )
    return motion.qd[moving, column], np.asarray(total)[moving]

"""A law that corrects simple friction of its joint, with that as terms of its own.

Alone it pushes where the joint has less friction than is named, so that no controller could feed
it forward: friction of one direction is named as half of it in both. Whole it takes energy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.laws.learned_torque import LearnedTorque
from ...effects.motion import Motion
from ..answer.cause import Cause
from ..answer.result import Leftover
from ..limits import LARGEST_LAW
from .discover import feeds_energy

_TERMS = {'joint_coulomb_friction': 'sign(x)', 'joint_viscous_friction': 'x'}
"""Simple friction as terms of a law of the joint's rate."""


def corrected_by(law: LearnedTorque, causes: Sequence[Cause]) -> list[Cause]:
    """Simple friction that a law of the joint's own rate has all of as terms."""
    own = [c for c in causes if c.applied.where == law.where and c.applied.id in _TERMS]
    is_of_rate = law.inputs == (f'rate/{law.where}',)
    terms = law.form.name.split(', ') if is_of_rate else ()
    return own if all(_TERMS[c.applied.id] in terms for c in own) else []


def with_friction(entry: Leftover, friction: Sequence[Cause], motion: Motion) -> Leftover:
    """What is said of a law, with friction that it corrects; not applied where it still pushes."""
    law = entry.applied
    if not isinstance(law, LearnedTorque):
        return entry
    terms, whole = law.form.name.split(', '), np.array(law.coefficients)
    for applied in (c.applied for c in friction):
        whole[terms.index(_TERMS[applied.id])] -= next(iter(applied.values.values()))
    free = replace(law, coefficients=tuple(whole.tolist()), limit=math.inf, kind='external')
    largest = float(np.max(np.abs(free.torque(motion, np.zeros((len(motion), 0))))))
    law = replace(free, limit=LARGEST_LAW * largest, kind='dissipative')
    if feeds_energy(law, [motion]):
        return replace(entry, applied=None)
    pairs = zip(entry.coefficients, law.coefficients, strict=True)
    values = tuple(replace(c, value=value) for c, value in pairs)
    return replace(entry, applied=law, kind=law.kind, coefficients=values)

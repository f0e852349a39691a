"""Campaign of laws that no catalogue knows: hidden in arms, asked for, held against the truth.

Every law of `hidden_laws`, inside and outside the grammar, at three times and once the noise, in
noise of all colours; and as many machines without any.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence

import numpy as np

from ..diagnosis.diagnose import diagnose
from ..effects.effect import Effect
from ..estimation.balance import balance_of
from ..estimation.observations import observed
from ..types import Array
from .description import Record, key
from .discovery_tables import judge as judge
from .discovery_tables import results as results
from .discovery_tables import tables as tables
from .hidden_laws import COLOURS, INSIDE, LAWS, LawArm
from .real_arm import JOINTS, arm_file

_RATIOS = (3.0, 1.0)
_DURATION = 40.0  # s
_MOVING = 3  # joints at once
_CLEAN = 4  # machines without a law, for every one with


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every law in turn, with as many machines without one in all colours."""
    out = []
    for seed in range(runs):
        for n, law in enumerate(LAWS):
            ratios = _RATIOS if law in INSIDE else _RATIOS[:1]
            colour = COLOURS[(seed + n) % len(COLOURS)]
            out += [key('law', 100 * seed + n, law, ratio, colour) for ratio in ratios]
        if not is_quick:
            clean = range(_CLEAN * len(LAWS) * seed, _CLEAN * len(LAWS) * (seed + 1))
            out += [key('clean', 10_000 + s, '', 0.0, COLOURS[s % len(COLOURS)]) for s in clean]
    return out


def run(key: str) -> Record:
    """Hide a law, ask, and compare what was learned along another motion."""
    kind, seed, law, ratio, colour = json.loads(key)
    rng = np.random.default_rng([seed, 7])
    moving = sorted(rng.choice(len(JOINTS), _MOVING, replace=False).tolist())
    j, k = rng.choice(moving, 2, replace=False).tolist()
    file, names = arm_file(), [JOINTS[i] for i in moving]
    arm = LawArm(seed, colour=colour, law=law, place=(j, k))
    if law:
        arm = arm.sized(ratio, names, _DURATION)
    started = time.perf_counter()
    answer = diagnose(arm.record(0, names, _DURATION), file.robot, file.effects)
    wall = time.perf_counter() - started
    learned = [e.applied for e in answer.leftover or () if e.applied is not None]
    added = [*(c.applied for c in answer.causes), *answer.calibration, *learned]
    said = [
        {
            'channel': e.channel.rpartition('/')[2],
            'depends_on': list(e.depends_on),
            'form': e.form,
            'p': e.p_value,
            'held_out': e.held_out_gain,
            'placebo': e.placebo_gain,
        }
        for e in answer.leftover or ()
    ]
    return {
        'kind': kind,
        'law': law,
        'ratio': ratio,
        'colour': colour,
        'where': JOINTS[j] if law else None,
        'variables': _variables(law, JOINTS[j], JOINTS[k]) if law else [],
        'said': said,
        'named': [[c.applied.id, c.applied.where] for c in answer.causes],
        'r2': _transferred(arm, j, names, added) if law else None,
        'wall_s': wall,
    }


def _variables(law: str, own: str, other: str) -> list[str]:
    names = {
        'v': f'rate/{own}',
        'w': f'rate/{other}',
        'q': f'angle/{own}',
        'p': f'angle/{other}',
        'T': f'load/{own}',
        't': 'time',
    }
    return [names[letter] for letter in LAWS[law][1]]


def _transferred(arm: LawArm, j: int, moving: Sequence[str], added: Sequence[Effect]) -> float:
    """Share of the law's variance on another motion that what was added explains there."""
    file = arm_file()
    balance = balance_of(
        observed(arm.record(1, moving, _DURATION), file.robot), file.robot, file.effects
    )
    motion = balance.motion
    true = arm.hidden_torque(motion.q, motion.qd, motion.effort)
    own: Array = np.zeros(len(true))
    for effect in added:
        if effect.where == JOINTS[j]:
            own = own + effect.force(motion, effect.driven(motion))[:, 6 + j]
    at = balance.arm.is_moving[:, j]
    return 1.0 - float(np.var(true[at] - own[at]) / np.var(true[at]))

"""Campaign of laws that no catalogue knows: hidden in arms, asked for, held against the truth.

Every law of `hidden_laws`, inside and outside the grammar, at three times and once the noise, in
noise of all colours; and machines without any.
"""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.laws.learned_torque import LearnedTorque
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.balance.balance import Balance, balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.record import Record
from spacerobot_ros.types import Array

from ..campaigns import Results, TrialRecord, grouped, key
from ..shares import share_of
from .hidden_laws import COLOURS, INSIDE, LAWS, LawArm, variables_of
from .real_arm import JOINTS, arm_file

_RATIOS = (3.0, 1.0)  # rms of a law by that of what is left
_DURATION = 40.0  # s
_MOVING = 3  # joints at once
_CLEAN = 4  # machines without a law, for every one with
_FASTER = 3.0  # times the speed of the data, at which a law must still be bounded


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every law in turn, with machines without one in all colours."""
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


def run(key: str) -> TrialRecord:
    """Hide a law, ask, and compare what was learned along another motion."""
    kind, seed, law, ratio, colour = json.loads(key)
    machine = HeldArm(seed, law, ratio, colour)
    record = machine.record()
    started = time.perf_counter()
    answer = diagnose(record, machine.file.robot, machine.file.effects)
    wall = time.perf_counter() - started
    learned = [e.applied for e in answer.leftover or () if e.applied is not None]
    added = [*(c.applied for c in answer.causes), *answer.calibration, *learned]
    claims = [
        {
            'channel': e.channel.rpartition('/')[2],
            'depends_on': list(e.depends_on),
            'form': e.form,
            'p': e.p_value,
            'held_out': e.held_out_gain,
            'rivals': [list(r.depends_on) for r in e.rivals],
        }
        for e in answer.leftover or ()
    ]
    return {
        'kind': kind,
        'law': law,
        'ratio': ratio,
        'colour': colour,
        'where': machine.where if law else None,
        'variables': machine.variables if law else [],
        'claims': claims,
        'named': [[*c.applied.key] for c in answer.causes],
        'r2': machine.transferred(added) if law else None,
        'beyond': beyond(learned, machine.motion) if law else None,
        'wall_s': wall,
    }


class HeldArm:
    """An arm on the ground with a law, some of whose joints move.

    Args:
        seed: Of all. law: Empty: none. ratio: Rms of the law by that of the noise.
        colour: Of the noise.
    """

    def __init__(self, seed: int, law: str, ratio: float, colour: str) -> None:
        rng = np.random.default_rng([seed, 7])
        moving = sorted(rng.choice(len(JOINTS), _MOVING, replace=False).tolist())
        self._j, self._k = rng.choice(moving, 2, replace=False).tolist()
        self.file, self._names = arm_file(), [JOINTS[i] for i in moving]
        self._arm = LawArm(seed, colour=colour, law=law, place=(self._j, self._k))
        if law:
            self._arm = self._arm.sized(ratio, self._names, _DURATION)
        self.where = JOINTS[self._j]

    def record(self) -> Record:
        """With the law."""
        return self._arm.record(0, self._names, _DURATION)

    @property
    def variables(self) -> list[str]:
        """That a right answer names."""
        return variables_of(self._arm.law, self.where, JOINTS[self._k])

    @property
    def motion(self) -> Motion:
        """That of the record."""
        return self._balance(self.record()).motion

    def _balance(self, record: Record) -> Balance:
        return balance_of(observed(record, self.file.robot), self.file.robot, self.file.effects)

    def transferred(self, added: Sequence[Effect]) -> float:
        """Share of the law's variance on another motion that what was added explains there."""
        balance = self._balance(self._arm.record(1, self._names, _DURATION))
        motion, j = balance.motion, self._j
        true = self._arm.hidden_torque(motion.q, motion.qd, motion.effort)
        own: Array = np.zeros(len(true))
        for effect in added:  # a coupled friction acts on two joints
            if effect.acts('force'):
                own = own + effect.force(motion, effect.driven(motion))[:, 6 + j]
        at = balance.arm.is_moving[:, j]
        return 1.0 - float(np.var(true[at] - own[at]) / np.var(true[at]))


def beyond(laws: Sequence[Effect], motion: Motion) -> tuple[float, float] | None:
    """Largest torque of any law at three times the speed, by that on the motion, and power fed in.

    The latter is the share of what friction exchanges; None where there is no law.
    """
    fast = replace(motion, qd=_FASTER * motion.qd, omega=_FASTER * motion.omega)
    sizes, fed = [0.0], [0.0]
    for law in laws:
        here, there = (law.force(m, law.driven(m)) for m in (motion, fast))
        sizes.append(float(np.max(np.abs(there)) / np.max(np.abs(here))))
        if isinstance(law, LearnedTorque) and (law.guard.kind == 'dissipative' or law.guard.react):
            power = np.sum(there * fast.rates, axis=1)
            given = np.sum(power) if law.hidden else np.sum(np.maximum(power, 0.0))
            fed.append(max(0.0, float(given)) / max(float(np.sum(np.abs(power))), 1e-300))
    return (max(sizes), max(fed)) if laws else None


_OF_CAUSES = {
    'joint_coulomb_friction': ('rate',),
    'joint_viscous_friction': ('rate',),
    'joint_stribeck_friction': ('rate',),
    'joint_friction_curvature': ('rate',),
    'joint_load_friction': ('rate', 'load'),
    'joint_presliding_friction': ('angle',),
    'joint_stiffness': ('angle',),
    'joint_torque_ripple': ('angle',),
}
"""Variables of what the catalogue has, as the grammar has them: of a history the angle."""
_OUTCOMES = ('own', 'named', 'false', 'misnamed', 'line', 'missed')
"""A law with the right variables; causes in its place that have them all and no others, and hold
on another motion; a law of others; other causes; only the line of a noise that is one; none, or
a function of the time that may be of these variables as well."""

# figures to reach, of laws in the grammar by their size over what is left, and of others: least
# share with the right variables, largest with wrong ones, least median R2 on another motion
_INSIDE = {3.0: (0.95, 0.05, 0.95), 1.0: (0.7, 0.0, None)}
_OUTSIDE = (0.7, 0.02, 0.8)


def results(records: Sequence[TrialRecord]) -> Results:
    """As `discovery`: shares by machine, ratio and law, and of machines without a law."""
    hidden = [r for r in records if r['kind'] == 'law']
    clean = [r for r in records if r['kind'] == 'clean']
    return {
        'discovery': {
            'groups': [{'group': g, **_score(own)} for g, own in grouped(hidden, _group).items()],
            'laws': [
                {'law': law, 'ratio': ratio, **_score(some)}
                for (ratio, law), some in grouped(hidden, _law).items()
            ],
            'applied': [_applied(hidden)] if hidden else [],
            'false': share_of(any(s['form'] is not None for s in r['claims']) for r in clean),
            'timed': share_of(
                any(s['depends_on'] == ['time'] for s in r['claims']) for r in clean
            ),
            'false_claims': [
                [r['colour'], s['channel'], s['form'], *s['depends_on']]
                for r in clean
                for s in r['claims']
                if s['form'] is not None
            ],
            'beside': share_of(_has_other(r) for r in hidden),
            'wall': float(np.median([r['wall_s'] for r in records])),
        }
    }


def _group(record: TrialRecord) -> str:
    where = 'inside' if record['law'] in INSIDE else 'outside'
    return f'arms, {where}, ratio {record["ratio"]:g}'


def _law(record: TrialRecord) -> tuple[float, str]:
    return record['ratio'], record['law']


def _applied(records: Sequence[TrialRecord]) -> dict[str, Any]:
    """What learned laws do beyond their data."""
    beyond = [r['beyond'] for r in records if r['beyond']]
    size, fed = np.max(beyond or [[np.nan, np.nan]], axis=0)
    return {
        'machines': 'arms',
        'learned': len(beyond),
        'beyond': float(size),
        'fed_in': float(fed),
    }


def _is_claimed(claim: TrialRecord) -> bool:
    return claim['form'] is not None or claim['depends_on'] == ['time']


def _own(record: TrialRecord) -> list[TrialRecord]:
    claims = (s for s in record['claims'] if s['channel'] == record['where'])
    return [s for s in claims if _is_claimed(s)]


def _is_open(claim: TrialRecord, variables: Sequence[str]) -> bool:
    """Whether a function of the time is said to be one of the law's variables as well."""
    return any(set(own) == set(variables) for own in claim['rivals'])


def _is_right(record: TrialRecord) -> bool:
    """Whether any claim of the law's joint has its variables, all of them and no others."""
    return any(set(s['depends_on']) == set(record['variables']) for s in _own(record))


def _is_explained(record: TrialRecord) -> bool:
    """Whether causes that are named at the joint have its variables, and hold elsewhere.

    What the catalogue has, or comes close to, has its best answer there.
    """
    place = record['where']
    own = [_OF_CAUSES.get(kind, ('other',)) for kind, where in record['named'] if where == place]
    named = {f'{quantity}/{place}' for quantities in own for quantity in quantities}
    return named == set(record['variables']) and record['r2'] > _OUTSIDE[2]


def _outcome(record: TrialRecord) -> str:
    """What the answer says of the law's joint, see `_OUTCOMES`."""
    own, has_line = _own(record), record['colour'] == 'line'
    if _is_right(record):
        return 'own'
    own = [s for s in own if s['form'] is not None or not _is_open(s, record['variables'])]
    if any(s['form'] is not None or not has_line for s in own):
        return 'false'
    if _is_explained(record):
        return 'named'
    if any(where in (record['where'], None) for _, where in record['named']):
        return 'misnamed'
    return 'line' if own else 'missed'


def _has_other(record: TrialRecord) -> bool:
    claims = (s for s in record['claims'] if s['channel'] != record['where'])
    return any(map(_is_claimed, claims))


def _score(records: Sequence[TrialRecord]) -> dict[str, Any]:
    found = [r['r2'] for r in records if _is_right(r) and r['variables'] != ['time']]
    outcomes = [_outcome(r) for r in records]
    return {
        'right': share_of(outcome in ('own', 'named') for outcome in outcomes),
        'wrong': share_of(outcome in ('false', 'misnamed') for outcome in outcomes),
        **{name: outcomes.count(name) for name in _OUTCOMES},
        'transfer': float(np.median(found)) if found else float('nan'),
        'worst': float(np.quantile(found, 0.1)) if found else float('nan'),
    }


def shown(results: Results) -> Results:
    """With false claims as text, and what is asked of a group."""
    s = results['discovery']
    claims = (', '.join(map(str, claim)) for claim in s['false_claims'])
    asked = [
        _OUTSIDE if ', outside' in g['group'] else _INSIDE[float(g['group'].rpartition(' ')[2])]
        for g in s['groups']
    ]
    names = ('least_right', 'most_wrong', 'least_transfer')
    groups = [
        {**g, **dict(zip(names, a, strict=True))} for g, a in zip(s['groups'], asked, strict=True)
    ]
    return {'discovery': {**s, 'groups': groups}, 'claims': '; '.join(claims) or '-'}

"""Whether an answer is right, wrong or silent: one rule for all that is asked.

- **wrong**: it names what is not there (no hidden effect, and none that it says it can not tell
  from the named one), or a value of a rightly named one is more than four of its standard
  deviations off (of a measured machine: outside the range that is known). Of an `identify`: a
  valid momentum with an axis so far off. Of a `check`: it finds something in a faultless record.
- **right**: all that is there is named, among causes or those too small to matter, or as what can
  not be told from a named one. Of a record in which nothing is hidden: it says that nothing is.
- **silent**: neither. Something is there and is not named, a clean record is called unexplained,
  an estimate is not valid, the data are refused.

Where the truth is known in part (`others`: a measured machine has friction that nobody stated),
further names are not wrong; where it is not known at all, the score is `null`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OFF = 4.0
"""Standard deviations from the truth beyond which a value is wrong."""
_CLEAN = ('consistent', 'unchanged', 'good')
_JUDGED = {  # those of several values that say how large an effect is; else xyz, or the first
    'inertial_parameters': ('mass',),
    'flexible_appendage': ('inertia', 'frequency'),
    'thruster_leak': ('force_x', 'force_y', 'force_z'),
    'effort_delay': (),  # when within its period an effort acts is a convention: half a sample
}
_NOMINAL = {'joint_torque_constant': 1.0, 'encoder_scale': 1.0, 'joint_rate_scale': 1.0}


def truth_of(line: Mapping[str, Any]) -> list[dict[str, Any]] | None:
    """What is there: names, and values or ranges [low, high]; None where nobody knows."""
    if 'data' in line:
        return line.get('truth')
    out = []
    for hidden in line.get('hidden', ()):
        effect, where, values = hidden['effect'], hidden['where'], dict(hidden['values'])
        usual = [p for p in 'xyz' if p in values] or list(values)[:1]
        nominal = _NOMINAL.get(effect, 0.0) if line['asked'] == 'compare' else 0.0
        judged = {p: values[p] - nominal for p in _JUDGED.get(effect, usual)}
        out.append({'name': f'{effect}@{where}' if where else effect, 'values': judged})
    return out


def scored(line: Mapping[str, Any], answer: Mapping[str, Any]) -> str | None:
    """`right`, `wrong` or `silent`, by the rule above."""
    truth = truth_of(line)
    if truth is None:
        return None
    if answer['verdict'] == 'refused':
        return 'silent'
    if answer['asked'] == 'identify':
        return _identified(truth, answer)
    if answer['asked'] == 'check':
        return 'right' if answer['verdict'] == 'good' else 'wrong'
    names = {t['name'] for t in truth}
    groups = [{name, *answer.get('rivals', {}).get(name, ())} for name in answer['names']]
    if not line.get('others') and any(not group & names for group in groups):
        return 'wrong'
    if any(_is_off(answer['values'].get(t['name'], {}), t) for t in truth):
        return 'wrong'
    if not truth:
        return 'right' if answer['verdict'] in _CLEAN or line.get('others') else 'silent'
    found = set(answer.get('minor', ())).union(*groups)
    return 'right' if names <= found else 'silent'


def _identified(truth: list[dict[str, Any]], answer: Mapping[str, Any]) -> str:
    if answer['verdict'] != 'valid':
        return 'silent'
    return 'wrong' if _is_off(answer['values']['wheel momentum'], truth[0]) else 'right'


def _is_off(found: Mapping[str, Any], truth: Mapping[str, Any]) -> bool:
    """Whether a value is too far from the truth for its deviation, or outside its range."""
    for parameter, true in truth.get('values', {}).items():
        if parameter not in found:
            continue
        value, std = found[parameter]
        if value is None:
            return True
        if isinstance(true, list):
            if not true[0] <= value <= true[1]:
                return True
        elif std and abs(value - true) > OFF * std:
            return True
    return False

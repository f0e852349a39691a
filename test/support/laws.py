"""Learned laws as entries of a robot file."""

from __future__ import annotations

from spacerobot_ros.effects.laws.grammar import FORMS, LawUnits, formula_name


def law_entry(form, inputs, coefficients, where, options=None, extra=None, **guard):
    """A form of the grammar with numbers, guarded: any torque up to 50 N m unless `guard` says."""
    units = {name: section.get('unit', '') for name, section in (extra or {}).items()}
    given = FORMS[form].entry(inputs, options or {}, LawUnits(where, extra=units))
    ranges = {formula_name(name, where): [-3.0, 3.0] for name in inputs}
    own = guard.pop('range', {})
    ranges |= {formula_name(n, where): ends for n, ends in own.items() if n in inputs}
    return {
        'effect': 'learned_torque',
        'where': where,
        **given,
        **({'extra': extra} if extra else {}),
        **{f'c{k}': c for k, c in enumerate(coefficients, 1)},
        'guard': {'range': ranges, 'limit': 50.0, 'kind': 'external', **guard},
    }

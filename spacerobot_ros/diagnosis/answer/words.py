"""Verdicts and causes in words, the same in every answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...effects.effect import Effect
from ...estimation.scaling import PROPORTIONAL
from ..limits import CLEAR
from .cause import Cause, Estimated
from .result import Leftover

_SHOWN = 3  # causes in one sentence; the others stand in the table
_NOTHING = 0.01  # of the largest number: what a short sentence leaves out


def verdict_of(is_good: bool, is_named: bool) -> str:
    """One of `VERDICTS`: by whether what is left is what a right model leaves."""
    if is_good:
        return 'explained' if is_named else 'consistent'
    return 'partly_explained' if is_named else 'unexplained'


def value_in_words(name: str, found: Estimated, sign: str = '') -> str:
    """A parameter with its standard deviation; `sign` is `+` where it is a change."""
    unit = f' {found.unit}' if found.unit else ''
    return f'{name} {found.value:{sign}.4g} +- {found.std:.2g}{unit}'


def cause_in_words(cause: Cause, *, is_short: bool = False) -> str:
    """A cause with its place and its values, all or those that say most."""
    shown, applied = cause.parameters, cause.applied
    if is_short:
        sizes = {p.name for p in applied.parameters if p.role in PROPORTIONAL}
        shown = telling({n: e for n, e in shown.items() if n in sizes} or shown)
    values = ', '.join(value_in_words(*item) for item in shown.items())
    return f'{applied.title}{at(applied.where)}{in_recordings(applied)} ({values})'


def telling(parameters: Mapping[str, Estimated]) -> dict[str, Estimated]:
    """Those of the unit of the first that are not next to nothing beside the largest.

    Where that first one may be nothing, as the mass of a body on joints that do not lift it, only
    what is clear counts, if anything is.
    """
    clear = {name: found for name, found in parameters.items() if _is_clear(found)}
    first = next(iter(parameters.values()))
    shown = parameters if _is_clear(first) or not clear else clear
    unit = next(iter(shown.values())).unit
    own = {name: found for name, found in shown.items() if found.unit == unit}
    least = _NOTHING * max(abs(found.value) for found in own.values())
    return {name: found for name, found in own.items() if abs(found.value) >= least}


def _is_clear(found: Estimated) -> bool:
    """Whether a number is clear of nothing; what is chosen or held is not said to be."""
    return abs(found.value) > CLEAR * found.std


def at(where: str | None) -> str:
    """The place of an effect, if it has one."""
    return f' at {where}' if where else ''


def in_recordings(effect: Effect) -> str:
    """The recordings that an effect is of alone, from 1; empty for all."""
    if effect.recordings is None:
        return ''
    numbers = ', '.join(str(1 + run) for run in effect.recordings)
    return f' in recording{"s" * (len(effect.recordings) > 1)} {numbers}'


def first_few(names: Sequence[str]) -> str:
    """What matters most, and how many more there are."""
    more = f'; and {len(names) - _SHOWN} more' if len(names) > _SHOWN else ''
    return '; '.join(names[:_SHOWN]) + more


def laws_in_words(laws: Sequence[Leftover]) -> str:
    """What the leftover goes with; laws that read alike are said once."""
    shown = (
        f' What is left of {law.channel} goes with {" and ".join(law.depends_on)} '
        f'like {law.resembles}.'
        for law in laws
    )
    return ''.join(dict.fromkeys(shown))

"""Numbers and units as text for people: as many digits as are known; words where none are."""

from __future__ import annotations

import math
from collections.abc import Iterable

SMALLEST = 1e-99  # probability that is worth its digits
UNTESTED = 'not tested'
NO_NUMBERS = ('', '-', 'never', 'none', UNTESTED)
"""What stands in the place of a number."""


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many digits; `never` for infinity, a dash where there is none."""
    if value is None or not math.isfinite(value):
        return 'never' if value is not None and value > 0.0 else '-'
    return f'{value:.{digits}g}'


def quantity(value: float | None, unit: str, digits: int = 3) -> str:
    """A number with its unit; what stands in the place of a number has none."""
    text = number(value, digits)
    return text if text in NO_NUMBERS else f'{text} {unit}'


def probability(p: float | None) -> str:
    """A probability; very small ones without their digits."""
    if p is None or math.isnan(p):
        return UNTESTED
    return f'< {SMALLEST:g}' if p < SMALLEST else number(p, 2)


def percent(share: float | None, form: str = '.1f', nothing: str = '-') -> str:
    """A share as a percentage."""
    return nothing if share is None or not math.isfinite(share) else f'{100.0 * share:{form}} %'


def value_with(value: float, std: float) -> str:
    """A value as far as its standard deviation lets it be known: two digits of that."""
    if not (math.isfinite(value) and math.isfinite(std)) or value == 0.0 or std <= 0.0:
        return number(value)
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f'{value:#.{min(max(digits, 2), 12)}g}'.rstrip('.')


def estimate(value: float, std: float, unit: str) -> str:
    """A value with its standard deviation and unit."""
    return f'{value_with(value, std)} +- {number(std, 2)} {unit}'.rstrip()


def decimals(std: float) -> int:
    """Decimals that show a standard deviation with two digits, and its value as far as it goes."""
    if not math.isfinite(std) or std <= 0.0:
        return 6
    return min(max(1 - math.floor(math.log10(std)), 0), 12)


def is_number(text: str) -> bool:
    """Whether a text begins as a number does."""
    try:
        float(text.replace('±', '').lstrip('<+- ').split(' ')[0].rstrip('%'))
    except ValueError:
        return False
    return True


def either(units: Iterable[str]) -> str:
    """Unit of what has several, such as `N m or N` of joints of which some slide."""
    return ' or '.join(dict.fromkeys(units))


def counted(count: int, one: str, many: str = '') -> str:
    """How many of something there are, such as `1 table` and `2 tables`.

    Args:
        count: Their number.
        one: What one is called.
        many: What others are called, where an `s` does not do.
    """
    return f'{count} {one if count == 1 else many or f"{one}s"}'

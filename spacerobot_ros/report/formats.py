"""Numbers as text, for people, and reports as Markdown.

As many digits as are known, and words where there is no number.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..display import Section, Table

SMALLEST = 1e-99  # probability that is worth its digits
UNTESTED = 'not tested'
NO_NUMBERS = ('', '-', 'never', 'none', UNTESTED)
"""What stands in the place of a number."""


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many digits; `never` for infinity, a dash where there is none."""
    if value is None or not math.isfinite(value):
        return 'never' if value is not None and value > 0.0 else '-'
    return f'{value:.{digits}g}'


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


def markdown(title: str, sections: Iterable[Section]) -> str:
    """A titled page of tables and texts; plots and key figures are left to HTML."""
    return '\n'.join([f'# {title}\n', *(_section(section) for section in sections)])


def _section(section: Section) -> str:
    parts = [f'## {section.title}\n\n']
    for item in section.items:
        if isinstance(item, Table):
            parts += [f'{line}\n\n' for line in (item.title, item.caption) if line]
            parts.append(markdown_table(item))
        elif isinstance(item, str):
            parts.append(f'{item}\n\n')
    return ''.join(parts)


def markdown_table(table: Table) -> str:
    """A table; what would end a cell is escaped."""
    rows = [table.head, ['---'] * len(table.head), *table.rows]
    return ''.join(f'| {" | ".join(_cell(c) for c in row)} |\n' for row in rows)


def _cell(text: str) -> str:
    return ' '.join(text.split()).replace('|', '\\|')

"""Tables of a report as Markdown, for pages that quote them."""

from __future__ import annotations

from collections.abc import Sequence

from ..display import Table


def markdown(title: str, tables: Sequence[tuple[str, Table]]) -> str:
    """A page of titled tables.

    Args:
        title: Of the page.
        tables: Title and table, in order.
    """
    parts = [f'# {title}\n']
    for name, table in tables:
        caption = f'{table.caption}\n\n' * bool(table.caption)
        parts.append(f'## {name}\n\n{caption}{markdown_table(table)}')
    return '\n'.join(parts)


def markdown_table(table: Table) -> str:
    """A table; what would end a cell is escaped."""
    rows = [table.head, ['---'] * len(table.head), *table.rows]
    return ''.join(f'| {" | ".join(_cell(c) for c in row)} |\n' for row in rows)


def _cell(text: str) -> str:
    return ' '.join(text.split()).replace('|', '\\|')

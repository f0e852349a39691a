"""Reports as Markdown, for pages that quote their tables."""

from __future__ import annotations

from collections.abc import Iterable

from ..display import Section, Table


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

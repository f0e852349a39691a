"""Events in tables, the same on the page and in the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from ..diagnosis.events.event import Event, Events
from ..display import Table, table_of
from ..formats import number, quantity
from .sentences import REASONS


def event_table(events: Events, caption: str = '') -> Table:
    """One row an event."""
    return table_of(
        [
            {'e': e, 'place': f'{e.where or ""}{events.place_of(e)}', 'peaks': _peaks(e)}
            for e in events.named
        ],
        'event | where | from [s] | to [s] | largest | z | p',
        '{e.effect} | {place} | {e.start:.2f} | {e.end:.2f} | {peaks} | {e.z:number 3} | '
        '{e.p_value:probability}',
        caption,
    )


def possible_lines(events: Events) -> Iterator[str]:
    """What is listed, and why it is not named."""
    for e in events.possible:
        place = f'{", ".join(e.joints)}{events.place_of(e)}'
        span = f'{e.start:.2f} to {e.end:.2f} s'
        yield f'{span} at {place}, z {e.z:.1f}: {REASONS[e.reason]}'


def limit_table(events: Events, caption: str = '') -> Table:
    """One row a joint or axis: from where on events are named, by duration."""
    limits = {name: limit for name, limit in events.limits.items() if limit}
    durations = next(iter(limits.values())).durations if limits else ()
    rows = [[name, *(quantity(p, it.unit) for p in it.peaks)] for name, it in limits.items()]
    return Table(['joint or axis', *(f'{d:g} s' for d in durations)], rows, caption)


def _peaks(event: Event) -> str:
    return ', '.join(
        f'{name} {number(peak, 3)} +- {number(event.peak_std[name], 2)} {event.units[name]}'
        for name, peak in event.peak.items()
    )

"""Events in tables, the same on the page and in the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from ..diagnosis.events.event import Event, EventLimit, Events, PossibleEvent
from ..display import Table, table_of
from ..formats import number, quantity

_REASONS = {
    'weak': 'below the limit, alone or beside a function of the state',
    'recurs': 'goes with the state of the joint: friction or an error of the model',
    'unvisited': 'at a state that the arm is in once: an error of the model would look the same',
    'stiction': 'beside a rest: friction may have changed its side',
    'edge': 'next to an end of the recording',
    'unexplained': 'the model explains too little of this joint',
    'friction': 'at rest, and nobody knows how much friction holds',
}


def event_table(events: Events, caption: str = '') -> Table:
    """One row an event."""
    return table_of(
        '',
        caption,
        [
            {'e': e, 'place': f'{e.where or ""}{events.place_of(e)}', 'peaks': _peaks(e)}
            for e in events.named
        ],
        'event | where | from [s] | to [s] | largest | z | p',
        '{e.effect} | {place} | {e.start:.2f} | {e.end:.2f} | {peaks} | {e.z:number 3} | '
        '{e.p_value:probability}',
    )


def possible_lines(events: Events) -> Iterator[str]:
    """What is listed, and why it is not named."""
    for e in events.possible:
        place = f'{", ".join(e.joints)}{events.place_of(e)}'
        yield f'{_span(e)} at {place}, z {e.z:.1f}: {_REASONS[e.reason]}'


def limit_table(events: Events, caption: str = '') -> Table:
    """One row a joint or axis: from where on events are named, by duration."""
    limits = [(name, limit) for name, limit in events.limits.items() if limit]
    durations = limits[0][1].durations if limits else ()

    rows = [[name, *_limits(limit)] for name, limit in limits]
    return Table(['joint or axis', *(f'{d:g} s' for d in durations)], rows, caption)


def _limits(limit: EventLimit) -> list[str]:
    return [quantity(peak, limit.unit) for peak in limit.peaks]


def _peaks(event: Event) -> str:
    return ', '.join(
        f'{name} {number(peak, 3)} +- {number(event.peak_std[name], 2)} {event.units[name]}'
        for name, peak in event.peak.items()
    )


def _span(event: PossibleEvent) -> str:
    return f'{event.start:.2f} to {event.end:.2f} s'

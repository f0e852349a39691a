"""What events make of a diagnosis."""

from __future__ import annotations

from dataclasses import replace

from ..events.event import Event, Events
from .result import Diagnosis
from .words import at, first_few

_WITH = {'consistent': 'explained', 'unexplained': 'partly_explained'}
"""Verdict by that of all other times, where an event is named."""


def with_events(diagnosis: Diagnosis, events: Events) -> Diagnosis:
    """A diagnosis of all other times with the events."""
    verdict, sentence = diagnosis.verdict, diagnosis.sentence
    if events.named:
        verdict = _WITH.get(verdict, verdict)
        sentence = f'{_in_words(events)} Besides: {sentence}'
    notes = (*diagnosis.notes, *events.notes)
    return replace(diagnosis, verdict=verdict, sentence=sentence, notes=notes, events=events)


def _in_words(events: Events) -> str:
    named = events.named
    count = 'one event' if len(named) == 1 else f'{len(named)} events'
    listed = first_few([_event(event, events.place_of(event)) for event in named])
    return f'Something from outside acts, {count}: {listed}.'


def _event(event: Event, place: str) -> str:
    name, peak = max(event.peak.items(), key=lambda item: abs(item[1]))
    size = f'{name} {peak:.3g} +- {event.peak_std[name]:.2g} {event.units[name]}'
    times = f'from {event.start:.2f} to {event.end:.2f} s'
    return f'{event.effect}{at(event.where)}{place} {times} ({size})'

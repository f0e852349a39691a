"""Steps of a free base's angular momentum: named above a limit, and what would have been."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...effects.effect import Effect
from ...estimation.fit import Fit
from ...estimation.refit import refine
from ...estimation.runs import Run
from .base_templates import LONGEST, BaseTemplates
from .event import Event, EventLimit, Events, PossibleEvent, Spans
from .naming_rule import chance, named_from
from .transient import AXES, BASE, Transient, event_of, possible_of
from .transient_search import TransientSearch

TAIL = 0.05  # s after an event in which nothing is used
_USUAL = ('target_wheel_momentum', 'thruster_gain', 'command_delay')
_ROUNDS = 4  # of steps that are left out
_SHOWN = 0.3  # s, the duration whose limit stands for all
_LASTS = LONGEST - 1e-6  # s, but for rounding
_UNJUDGED = 'steps of the momentum are not judged'
_SHARE = 0.3  # of a record that events may take, as their level is that of all other times


class MomentumSteps:
    """All steps of the angular momentum beside a fit.

    Args:
        fit: Of a free base.
    """

    def __init__(self, fit: Fit) -> None:
        self._robot, self._templates = fit.run.robot, BaseTemplates(fit)
        self._search = TransientSearch(self._templates)
        self.found = sorted(self._search.found, key=lambda p: p.start)
        self.is_steady = self._search.is_steady

    @property
    def standing_out(self) -> Spans:
        """Times of what is large even by the scatter of what is left, and short."""
        longest = max(self._templates.durations, default=0.0)
        return _spans(p for p in self.found if p.duration < longest)

    @cached_property
    def events(self) -> Events:
        """All of them."""
        templates, found = self._templates, self.found
        if _SHOWN not in templates.durations:
            why = f'{templates.seconds:.3g} s are too short'
            return Events(limits=dict.fromkeys(AXES), notes=(f'{why}: {_UNJUDGED}',))
        lengths = [p.duration for p in found]
        comes_and_goes = max(lengths, default=0.0) < _LASTS
        if not (self.is_steady and comes_and_goes and sum(lengths) < _SHARE * templates.seconds):
            why = 'what is left beside the wheels is no noise'
            return Events(limits=dict.fromkeys(AXES), notes=(f'{why}: {_UNJUDGED}',))
        limit = named_from([p.z for p in found], templates.seconds / 3600.0)
        cells = sum(2.0 / d for d in templates.durations) * templates.seconds
        stds = [self._search.usual_std(BASE, d) for d in templates.durations]
        return Events(
            named=tuple(self._event(p, cells) for p in found if p.z >= limit),
            possible=tuple(possible_of(self._robot, [p], 'weak') for p in found if p.z < limit),
            limits={
                axis: EventLimit.of(limit, _SHOWN, templates.durations, own, 'N m s')
                for axis, own in zip(AXES, np.transpose(stds).tolist(), strict=True)
            },
        )

    def _event(self, p: Transient, cells: float) -> Event:
        event = event_of(self._robot, [p], chance(p.z, cells), self._templates.seconds)
        return replace(event, middle_std=self._search.middle_std(p))


def steps_beside_usual(run: Run, causes: Sequence[Effect] = ()) -> tuple[Events, Spans]:
    """Steps of a run beside what is wrong of most: wheels that nobody knows, its thrusters.

    None where that leaves too much for a step to be told from it. A step that is large even so
    spoils what is fitted to it, delays most of all: its times are left out, and all is fitted and
    looked for again. Where that does not help these times are returned.

    Args:
        run: The run.
        causes: What is known to be wrong of it.
    """
    known = {cause.key for cause in causes}
    usual = [*causes, *(effect for effect in usual_causes(run) if effect.key not in known)]
    spans: Spans = ()
    tried = {spans}
    steps = MomentumSteps(refine(run, usual))
    for _ in range(_ROUNDS):
        if steps.is_steady or (ahead := steps.standing_out) in tried:
            break
        tried.add(spans := ahead)
        steps = MomentumSteps(Fit(run, refine(run.without(spans), usual).causes))
    return steps.events, spans


def usual_causes(run: Run) -> list[Effect]:
    """What is wrong of most free bases."""
    return [
        kind(name=f'{kind.id}_{where}', where=where, values=kind.nominal())
        for kind in map(CATALOGUE.__getitem__, _USUAL)
        for where in kind.fitted_places(run.robot)
    ]


def spans_of(events: Events) -> Spans:
    """Times that events take, listed ones too, and what sensors spread of their ends [s]."""
    return _spans(events.all)


def _spans(found: Iterable[Event | PossibleEvent | Transient]) -> Spans:
    return tuple((p.start - TAIL, p.end + TAIL) for p in found)

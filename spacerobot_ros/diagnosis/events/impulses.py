"""Steps of a free base's angular momentum: named above a limit, and what would have been."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...effects.effect import Effect
from ...effects.surroundings.external import AngularImpulse
from ...estimation.fit import Fit
from ...estimation.refit import refine
from ...estimation.runs import Run
from ...types import Array
from .event import Event, EventLimit, Events, PossibleEvent, Spans
from .event_limits import NAMED, SNR, chance, named_from
from .impulse_fit import EDGE, Impulse, ImpulseFit
from .impulse_scan import AXES, ImpulseScan
from .impulse_sizes import TAIL

_USUAL = ('target_wheel_momentum', 'thruster_gain', 'command_delay')
_ROUNDS = 4  # of steps that are left out
_SHOWN = 0.3  # s, the duration whose limit stands for all


def impulse_events(fit: Fit) -> Events:
    """Steps of the angular momentum, named above a limit.

    Args:
        fit: Of a free base, what lasts in it.
    """
    return _events(ImpulseScan(fit))


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
    usual = [*causes, *(effect for effect in _usual(run) if effect.key not in known)]
    spans: Spans = ()
    tried = {spans}
    scan = ImpulseScan(refine(run, usual))
    for _ in range(_ROUNDS):
        if scan.is_steady or (ahead := _spans(scan.standing_out)) in tried:
            break
        tried.add(spans := ahead)
        scan = ImpulseScan(Fit(run, refine(run.without(spans), usual).causes))
    return _events(scan), spans


def covariances(run: Run, times: Array) -> list[Array]:
    """(3, 3) of impulses at known times, beside each other and what is wrong of most.

    Args:
        run: Without any.
        times: (M, 2) as of `ImpulseFit`.
    """
    return ImpulseFit(refine(run, _usual(run)), times).covariances


def _usual(run: Run) -> list[Effect]:
    return [
        kind(name=f'{kind.id}_{where}', where=where, values=kind.nominal())
        for kind in map(CATALOGUE.__getitem__, _USUAL)
        for where in kind.fitted_places(run.robot)
    ]


def large_steps(fit: Fit) -> Spans:
    """Times of steps that are large even by what a fit leaves."""
    return _spans(ImpulseScan(fit).standing_out)


def spans_of(events: Events) -> Spans:
    """Times that events take, listed ones too, and what sensors spread of their ends [s]."""
    return _spans(events.all)


def _spans(found: Iterable[Event | PossibleEvent | Impulse]) -> Spans:
    return tuple((i.start - TAIL, i.end + TAIL) for i in found)


def _events(scan: ImpulseScan) -> Events:
    if _SHOWN not in scan.durations:
        why = f'{scan.seconds:.3g} s are too short for steps of the momentum to be judged'
        return Events(limits=dict.fromkeys(AXES), notes=(why,))
    if not (scan.is_steady and scan.is_transient):
        why = 'what is left beside the wheels is no noise: steps of the momentum are not judged'
        return Events(limits=dict.fromkeys(AXES), notes=(why,))
    limit = named_from([i.z for i in scan.found], scan.seconds / 3600.0)
    cells = sum(2.0 / d for d in scan.durations) * scan.seconds
    named = [_event(scan, i, cells) for i in scan.found if i.z >= limit]
    possible = [
        PossibleEvent(
            start=i.start, end=i.end, joints=(), z=i.z, reason='weak', applied=_applied(i)
        )
        for i in scan.found
        if i.z < limit
    ]
    snr = SNR if limit <= NAMED else SNR * limit / NAMED
    stds = np.transpose([scan.usual_std(d) for d in scan.durations])
    limits = {
        axis: EventLimit(
            duration=_SHOWN,
            durations=scan.durations,
            peaks=tuple((snr * own).tolist()),
            unit='N m s',
            snr=snr,
        )
        for axis, own in zip(AXES, stds, strict=True)
    }
    return Events(named=tuple(named), possible=tuple(possible), limits=limits)


def _event(scan: ImpulseScan, found: Impulse, cells: float) -> Event:
    return Event(
        effect=AngularImpulse.id,
        where=None,
        joints=(),
        start=max(found.start, 0.0),
        end=found.end,
        middle_std=scan.middle_std(found),
        ongoing=found.end >= scan.seconds,
        peak=dict(zip(AXES, found.value.tolist(), strict=True)),
        peak_std=dict(zip(AXES, found.std.tolist(), strict=True)),
        units=dict.fromkeys(AXES, 'N m s'),
        z=found.z,
        p_value=chance(found.z, cells),
        applied=_applied(found),
    )


def _applied(found: Impulse) -> tuple[Effect, ...]:
    sizes = dict(zip(AXES, found.value.tolist(), strict=True))
    values = {'start': max(found.start, 0.0), 'end': found.end, 'edge': EDGE, **sizes}
    return (AngularImpulse(name='event', where=None, values=values),)

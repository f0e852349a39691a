"""Steps of a free base's angular momentum: named above a limit, and what would have been."""

from __future__ import annotations

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...effects.surroundings.external import AngularImpulse
from ...estimation.refit import Fit, refine
from ...estimation.runs import Run
from .event import Event, EventLimit, Events, PossibleEvent
from .event_limits import NAMED, SNR, chance, named_from
from .impulse_fit import EDGE, Impulse
from .impulse_scan import AXES, TAIL, ImpulseScan

_SHOWN = 0.3  # s, the duration whose limit stands for all


def impulse_events(fit: Fit) -> Events:
    """Steps of the angular momentum, named above a limit.

    Args:
        fit: Of a free base, what lasts in it.
    """
    scan = ImpulseScan(fit)
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
        PossibleEvent(start=i.start, end=i.end, joints=(), z=i.z, reason='weak')
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


def steps_beside_wheels(run: Run) -> Events:
    """Steps of a run beside the wheels that nobody knows.

    None where that leaves too much for a step to be told from it.
    """
    kind = CATALOGUE['target_wheel_momentum']
    wheels = [
        kind(name=f'wheels_{where}', where=where, values=kind.nominal())
        for where in kind.fitted_places(run.robot)
    ]
    return impulse_events(refine(run, wheels))


def spans_of(events: Events) -> tuple[tuple[float, float], ...]:
    """Times that named events take, and what sensors spread of their ends [s]."""
    return tuple((e.start - TAIL, e.end + TAIL) for e in events.named)


def _event(scan: ImpulseScan, found: Impulse, cells: float) -> Event:
    sizes = dict(zip(AXES, found.value.tolist(), strict=True))
    values = {'start': max(found.start, 0.0), 'end': found.end, 'edge': EDGE, **sizes}
    return Event(
        effect=AngularImpulse.id,
        where=None,
        joints=(),
        start=values['start'],
        end=found.end,
        middle_std=scan.middle_std(found),
        ongoing=found.end >= scan.seconds,
        peak=sizes,
        peak_std=dict(zip(AXES, found.std.tolist(), strict=True)),
        units=dict.fromkeys(AXES, 'N m s'),
        z=found.z,
        p_value=chance(found.z, cells),
        applied=(AngularImpulse(name='event', where=None, values=values),),
    )

"""What the monitor says of a flight, in figures and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..events.event import Event
from .probes import Probe
from .sequential_tests import Verdict
from .window_whiteness import Structure

_SUSPECT = 0.7  # of the threshold


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelState:
    """One channel in which the model may fail.

    Args:
        name: Such as `joint_2 torque`.
        unit: Of `unexplained`.
        level: `ok`, `warn` (evidence above 0.7) or `error`.
        reason: In words; empty where nothing is wrong.
        unexplained: What the model does not explain, by the last block. std: Of it.
        rms: Residual over its noise floor in the window; nan for a torque, which has no sensor of
            its own.
        whiteness_p: Probability of as much structure in the window; nan as above.
        evidence: Strongest test over the threshold; 1 raises an alarm.
    """

    name: str
    unit: str
    level: str
    reason: str
    unexplained: float
    std: float
    rms: float
    whiteness_p: float
    evidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorState:
    """What the monitor knows.

    Args:
        level: `ok`, `warn`, `error`, or `stale` while nothing is judged.
        reason: One line.
        judged_ns: Stamp up to which the flight is judged [ns]; None: nothing is.
        raised_ns: Stamp at which the present alarm was raised [ns]; None without one.
        first: Channel that spoke first in the present or last alarm; empty where there was none.
        alarms: Number of alarms so far.
        event: The last event; None: there was none.
        events: Number of them.
        momentum: (p,) what is believed of the captured wheels, link after link, each in its link
            frame [N m s]. momentum_std: Of it.
        channels: Every channel.
        notes: How the flight is judged.
    """

    level: str = 'stale'
    reason: str = 'nothing received yet'
    judged_ns: int | None = None
    raised_ns: int | None = None
    first: str = ''
    alarms: int = 0
    event: Event | None = None
    events: int = 0
    momentum: tuple[float, ...] = ()
    momentum_std: tuple[float, ...] = ()
    channels: tuple[ChannelState, ...] = ()
    notes: tuple[str, ...] = ()


def channel_states(
    probes: Sequence[Probe], verdict: Verdict, structure: Structure, threshold: float
) -> tuple[ChannelState, ...]:
    """Every channel after a block."""
    out = []
    for k, probe in enumerate(probes):
        fit = structure.fits[k]
        level = 'ok'
        if verdict.alarmed[k]:
            level = 'error'
        elif verdict.evidence[k] >= _SUSPECT * threshold:
            level = 'warn'
        out.append(
            ChannelState(
                name=probe.name,
                unit=probe.unit,
                level=level,
                reason='' if level == 'ok' else _reason(k, probe, verdict, structure),
                unexplained=float(verdict.value[k]),
                std=float(verdict.std[k]),
                rms=float('nan') if fit is None else fit.spread,
                whiteness_p=float('nan') if fit is None else fit.p_value,
                evidence=float(verdict.evidence[k]) / threshold,
            )
        )
    return tuple(out)


def _reason(k: int, probe: Probe, verdict: Verdict, structure: Structure) -> str:
    fit = structure.fits[k]
    if fit is not None and structure.evidence[k] >= verdict.evidence[k]:
        what = f'a line at {fit.frequency:.3g} Hz' if fit.question == 'line' else 'a slow error'
        return f'{probe.name}: {what} in the residual'
    if verdict.loud[k]:
        return f'{probe.name}: residual {verdict.rms[k]:.3g} times its noise floor'
    return f'{probe.name}: unexplained {verdict.value[k]:.2g} {probe.unit}'

"""An event, what may be one, and from where on one is seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...effects.effect import Effect
from ...formats import either
from ...json_values import json_as, json_fields
from ..limits import FALSE_PER_HOUR
from .naming_rule import ROOM

Spans = tuple[tuple[float, float], ...]
"""Starts and ends of times that nothing constant is estimated from [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """What came from outside for a while.

    Args:
        effect: Its id.
        where: Joint, or `link or beyond`; None: the system.
        joints: Joints that feel it.
        start: Since the recording's start [s]. end: [s].
        ongoing: Whether it reaches the recording's end.
        peak: Largest torque from outside by joint; or impulse by axis. In flight the mean torque
            since its start, or the impulse, as of when they were seen best.
        peak_std: Their standard deviations; of a joint at rest what its friction may take.
        units: Of both, by the same names.
        z: Size by standard deviation.
        p_value: Of such a size by chance; None where that was not computed.
        false_per_hour: Rate of false names that the limit is made for.
        rivals: What it can not be told from, in words.
        recording: Number of the recording.
        applied: The same as effects of the extended model.
        wrench: Force and torque at the link's origin in its frame, with deviations; None: unknown.
        middle_std: Standard deviation of the middle of its time [s]; None where not computed.
    """

    json_too = ('unit',)
    effect: str
    where: str | None
    joints: tuple[str, ...]
    start: float
    end: float
    ongoing: bool
    peak: Mapping[str, float]
    peak_std: Mapping[str, float]
    units: Mapping[str, str]
    z: float
    p_value: float | None = None
    false_per_hour: float = FALSE_PER_HOUR
    rivals: tuple[str, ...] = ()
    recording: int = 0
    applied: tuple[Effect, ...] = json_as(default=())
    wrench: Mapping[str, tuple[float, float]] | None = None
    middle_std: float | None = None

    def in_words(self) -> str:
        """One line of an event that goes on."""
        place = f' at {self.where}' if self.where else ''
        name, size = max(self.peak.items(), key=lambda item: abs(item[1]))
        largest = f'{name} {size:.3g} {self.units[name]}'
        return f'{self.effect}{place} since {self.start:.2f} s ({largest})'

    @property
    def unit(self) -> str:
        """Of all peaks, such as `N m or N` where joints differ."""
        return either(self.units.values())

    def to_json(self) -> dict[str, Any]:
        """As in diagnosis.json."""
        impulse = dict(self.peak) if self.effect == 'angular_impulse' else None
        wrench: Any = self.wrench and {
            name: {'value': value, 'std': std, 'unit': 'N' if name.startswith('force') else 'N m'}
            for name, (value, std) in self.wrench.items()
        }
        return json_fields(self) | {'impulse': impulse, 'wrench': wrench}


@dataclass(frozen=True, slots=True, kw_only=True)
class PossibleEvent:
    """What is listed and not named, and why.

    Args:
        start: [s]. end: [s]. joints: That feel it. z: Size by standard deviation.
        reason: `weak`, `recurs`, `unvisited`, `stiction`, `edge`, `unexplained` or `friction`.
        recording: Number of the recording.
        applied: The same as effects of a model, where sizes are known.
    """

    start: float
    end: float
    joints: tuple[str, ...]
    z: float
    reason: str
    recording: int = 0
    applied: tuple[Effect, ...] = json_as(default=())


@dataclass(frozen=True, slots=True, kw_only=True)
class EventLimit:
    """From where on 95 % of events are named, on one joint.

    Args:
        duration: Of an event, the one that is shown [s].
        durations: All of which something is said [s]. peaks: Largest torque of each.
        unit: Of these. snr: Peak by standard deviation.
    """

    json_too = ('peak',)
    duration: float
    durations: tuple[float, ...]
    peaks: tuple[float, ...]
    unit: str
    snr: float

    @classmethod
    def of(
        cls,
        limit: float,
        shown: float,
        durations: tuple[float, ...],
        stds: Sequence[float],
        unit: str,
    ) -> EventLimit:
        """By the z that is named and usual standard deviations of every duration."""
        snr = ROOM * limit
        peaks = tuple(snr * std for std in stds)
        return cls(duration=shown, durations=durations, peaks=peaks, unit=unit, snr=snr)

    @property
    def peak(self) -> float:
        """Of the duration that is shown."""
        return self.peaks[self.durations.index(self.duration)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """All of some recordings.

    Args:
        named: By time. possible: By time.
        limits: By joint or axis; None: it is not judged.
        notes: What else a user should know.
        recordings: Number of the recordings that were looked at.
    """

    named: tuple[Event, ...] = json_as('events', default=())
    possible: tuple[PossibleEvent, ...] = json_as('possible_events', default=())
    limits: Mapping[str, EventLimit | None] = json_as('event_limits', default_factory=dict)
    notes: tuple[str, ...] = json_as(default=())
    recordings: int = json_as(default=1)

    @property
    def is_judged(self) -> bool:
        """Whether any would be named."""
        return any(self.limits.values())

    @property
    def all(self) -> tuple[Event | PossibleEvent, ...]:
        """Named ones and possible ones."""
        return (*self.named, *self.possible)

    def place_of(self, event: Event | PossibleEvent) -> str:
        """The recording of an event, from 1, where there are several."""
        return f' in recording {1 + event.recording}' if self.recordings > 1 else ''

    def with_more(self, other: Events) -> Events:
        """Those of both."""
        return Events(
            named=tuple(sorted((*self.named, *other.named), key=_time)),
            possible=tuple(sorted((*self.possible, *other.possible), key=_time)),
            limits={
                name: self.limits.get(name) or other.limits.get(name)
                for name in {**self.limits, **other.limits}
            },
            notes=(*self.notes, *other.notes),
            recordings=max(self.recordings, other.recordings),
        )


def _time(event: Event | PossibleEvent) -> tuple[int, float]:
    return event.recording, event.start

r"""Pushes of an arm that is held still.

At rest friction holds any torque between minus and plus its bound T, so that motor torques say
nothing of gravity, springs or biases, and wander. What goes farther than that is held against
something from outside: an event is where the torque of any joint is more than `REST_SHARE` T off
its usual value, and its size is known within T.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_closing, binary_opening, label

from ...estimation.balance import Balance
from ...types import Array, BoolArray
from .contact import Pulse, event_of
from .event import Event, PossibleEvent
from .event_limits import FRICTION_SHARE, REST_SHARE, SNR

_SHORTEST = 0.15  # s beyond the bound
_GAP = 0.3  # s below it that do not end an event
_STRETCH = 1.5  # s of rest, for a usual value
_SETTLED = 0.3  # s after a motion and before one
_LEVEL = (0.3, 0.8)  # s before and after an event, where torques are as without it
_FOOT = 0.15  # of the change: where it begins and ends
_FELT = 1.0  # Coulomb torques that a joint must change by to feel it
_EDGE = 0.25  # of its duration: a push that is held
_LAG = 0.1  # s between samples whose differences are noise
_LARGE = 0.4  # of the largest deviation: what is listed where nobody knows the friction


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """A stretch in which no joint moves.

    Args:
        run: Number of the recording.
        time: (N,) [s].
        torque: (N, n) what the model misses, less its usual value [N m].
        noise: (n,) its fast scatter [N m].
        last: End of the recording [s].
    """

    run: int
    time: Array
    torque: Array
    noise: Array
    last: float

    def cores(self, bound: Array) -> Iterator[slice]:
        """Where any joint is beyond a bound (n,) for a while."""
        step = float(self.time[1] - self.time[0])
        beyond = np.any(np.abs(self.torque) > bound, axis=1)
        beyond = binary_opening(beyond, np.ones(max(1, round(_SHORTEST / step))))
        gap = round(_GAP / step)
        beyond = binary_closing(np.pad(beyond, gap), np.ones(gap + 1))[gap:-gap]
        labels, count = label(beyond)
        for k in range(1, count + 1):
            at = np.flatnonzero(labels == k)
            yield slice(int(at[0]), int(at[-1]) + 1)


def rests(balance: Balance, run: int, bound: Array) -> Iterator[Rest]:
    """All stretches of rest of a recording.

    Args:
        balance: The model along it.
        run: Its number.
        bound: (n,) Coulomb torques [N m].
    """
    arm = balance.arm
    known = arm.is_known
    still = ~arm.is_moving.any(axis=1) & known
    settled = round(_SETTLED / arm.step)
    labels, count = label(still)
    missed = arm.in_band(balance.missed)
    for k in range(1, count + 1):
        at = np.flatnonzero(labels == k)
        first = at[0] + (settled if at[0] > 0 and known[at[0] - 1] else 0)
        last = at[-1] - (settled if at[-1] + 1 < len(known) and known[at[-1] + 1] else 0)
        own = slice(int(first), int(last) + 1)
        if (last - first) * arm.step < _STRETCH:
            continue
        torque = missed[own] - [_usual(*x) for x in zip(missed[own].T, bound, strict=True)]
        lag = max(1, round(_LAG / arm.step))
        noise = 1.5 * np.median(np.abs(torque[lag:] - torque[:-lag]), axis=0)
        yield Rest(run, arm.times[own], torque, noise, float(arm.times[-1]))


def rest_events(
    balance: Balance, run: int, friction: Array
) -> tuple[list[Event], list[PossibleEvent]]:
    """Named and possible events of one recording where no joint moves.

    Args:
        balance: The model along it.
        run: Its number.
        friction: (n,) Coulomb torques; nan where nobody knows [N m].
    """
    robot = balance.robot
    unknown = np.isnan(friction)
    bound = np.where(unknown, FRICTION_SHARE * robot.effort_limits, friction)
    bound[_unmeasured(balance)] = np.inf
    named: list[Event] = []
    possible: list[PossibleEvent] = []
    for rest in rests(balance, run, bound):
        taken = np.zeros(len(rest.time), dtype=bool)
        for core in rest.cores(REST_SHARE * bound):
            span = _span(rest, core, bound)
            taken[span] = True
            named.append(_event(balance, rest, core, span, bound))
        large = np.maximum(_LARGE * np.max(np.abs(rest.torque), axis=0), SNR * rest.noise)
        large = np.where(unknown & ~_unmeasured(balance), large, np.inf)
        possible += [
            _possible(balance, rest, core, large)
            for core in rest.cores(large)
            if not taken[core].any()
        ]
    return named, possible


def _unmeasured(balance: Balance) -> BoolArray:
    """(n,) joints without efforts."""
    effort = balance.arm.record.effort
    return np.isnan(effort[0]) if effort is not None else np.ones(balance.robot.n_joints, bool)


def _span(rest: Rest, core: slice, bound: Array) -> slice:
    """From where the torque that is farthest beyond its bound leaves its level, to its return."""
    most = np.max(np.abs(rest.torque[core]), axis=0) / bound
    x = rest.torque[:, int(np.argmax(most))]
    peak = x[core][np.argmax(np.abs(x[core]))]
    before, after = _levels(rest, core, x[:, None])
    first, last = core.start, core.stop - 1
    while first > 0 and (x[first] - before[0]) / (peak - before[0]) > _FOOT:
        first -= 1
    while last < len(x) - 1 and (x[last] - after[0]) / (peak - after[0]) > _FOOT:
        last += 1
    return slice(first, last + 1)


def _levels(rest: Rest, core: slice, x: Array) -> tuple[Array, Array]:
    """(n,) medians before and after; zero, the usual value, where a recording ends."""
    step = float(rest.time[1] - rest.time[0])
    near, far = (round(t / step) for t in _LEVEL)
    before = x[max(core.start - far, 0) : max(core.start - near, 0)]
    after = x[core.stop + near : core.stop + far]
    none = np.zeros(x.shape[1])
    return tuple(np.median(part, axis=0) if len(part) else none for part in (before, after))  # type: ignore[return-value]


def _event(balance: Balance, rest: Rest, core: slice, span: slice, bound: Array) -> Event:
    before, _ = _levels(rest, span, rest.torque)
    change = rest.torque[span] - before
    peaks = change[np.argmax(np.abs(change), axis=0), np.arange(change.shape[1])]
    start, end = float(rest.time[span][0]), float(rest.time[span][-1])
    felt = np.flatnonzero(np.abs(peaks) > _FELT * bound)
    if not len(felt):
        felt = np.array([int(np.argmax(np.abs(peaks) / bound))])
    pulses = [
        Pulse(
            int(j),
            rest.run,
            start,
            end,
            _EDGE,
            float(peaks[j]),
            float(bound[j]),
            float(peaks[j] / bound[j]),
        )
        for j in felt
    ]
    return event_of(balance.robot, pulses, None, rest.last)


def _possible(balance: Balance, rest: Rest, core: slice, large: Array) -> PossibleEvent:
    sizes = np.max(np.abs(rest.torque[core]), axis=0)
    joints = np.flatnonzero(sizes > large)
    return PossibleEvent(
        start=float(rest.time[core][0]),
        end=float(rest.time[core][-1]),
        joints=tuple(balance.robot.joints[j] for j in joints),
        z=float(np.max(sizes[joints] / np.maximum(rest.noise[joints], 1e-12))),
        reason='friction',
        recording=rest.run,
    )


def _usual(values: Array, bound: float) -> float:
    """Middle of the most values that friction can make of one load.

    Args:
        values: (N,) torques of one joint at rest [N m].
        bound: Its Coulomb torque [N m]; infinite where nobody knows.
    """
    x = np.sort(values)
    end = np.searchsorted(x, x + 2.0 * bound, side='right')
    first = int(np.argmax(end - np.arange(len(x))))
    return float(np.median(x[first : end[first]]))

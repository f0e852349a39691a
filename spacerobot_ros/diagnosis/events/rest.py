r"""Pushes on joints that are held still, alone or while others move.

At rest friction holds any torque between minus and plus its bound T, so that motor torques say
nothing of gravity, springs or biases, and wander. What goes farther than that, and than the model
may be wrong while others move, is held against something from outside: an event is where the
torque of a joint is more than `REST_SHARE` T off its usual value, and its size is known within T.

Where T is small the noise of the sensors counts, too, and next to a motion what the model misses
of it: the filter of the balance brings that into a rest, ever less of it the longer it lasts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import binary_closing, binary_opening, label

from ...estimation.balance.arm_motion import ArmMotion
from ...estimation.balance.balance import Balance, own_noise_in_band
from ...model.robot import Robot
from ...types import Array, BoolArray
from ..limits import FRICTION_SHARE, LISTED, REST_SHARE
from .event import EventLimit, Events, PossibleEvent
from .joint_templates import DURATIONS
from .naming import MovingArm
from .transient import Transient, are_in_line, event_of, possible_of

_SHORTEST = 0.15  # s beyond the bound
_GAP = 0.3  # s below it that do not end an event
_STRETCH = 1.5  # s of rest, for a usual value
_SETTLED = 0.3  # s after a motion and before one
_LEVEL = (0.3, 0.8)  # s before and after an event, where torques are as without it
_FOOT = 0.15  # of the change: where it begins and ends
_FELT = 1.0  # Coulomb torques that a joint must change by to feel it
_EDGE = 0.25  # of its duration: a push that is held
_LAG = 0.1  # s between samples whose differences are noise
_CLEAR = 20.0  # times the fast scatter, of what is listed there
_LARGE = 0.4  # of the largest deviation: what is listed where nobody knows the friction


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """A stretch in which a joint does not move.

    Args:
        joint: Its number. run: Number of the recording.
        time: (N,) [s].
        torque: (N,) what the model misses, less its usual value [N m].
        bound: (N,) what friction holds, and how wrong the model may be [N m].
        noise: Its fast scatter [N m].
    """

    joint: int
    run: int
    time: Array
    torque: Array
    bound: Array
    noise: float

    def cores(self, share: float, least: float = 0.0) -> Iterator[slice]:
        """Where it is beyond a share of the bound, and a torque [N m], for a while."""
        step = float(self.time[1] - self.time[0])
        bound = self.bound.copy()  # no share of what holds anything is less
        bound[np.isfinite(bound)] *= share
        beyond = np.abs(self.torque) > np.maximum(bound, least)
        beyond = binary_opening(beyond, np.ones(max(1, round(_SHORTEST / step))))
        gap = round(_GAP / step)
        beyond = binary_closing(np.pad(beyond, gap), np.ones(gap + 1))[gap:-gap]
        labels, count = label(beyond)
        for k in range(1, count + 1):
            at = np.flatnonzero(labels == k)
            yield slice(int(at[0]), int(at[-1]) + 1)

    def span(self, core: slice) -> slice:
        """From where the torque leaves its level before, to its return to the one after."""
        x = self.torque
        peak = x[core][np.argmax(np.abs(x[core]))]
        before, after = self._levels(core)
        first, last = core.start, core.stop - 1
        while first > 0 and (x[first] - before) / (peak - before) > _FOOT:
            first -= 1
        while last < len(x) - 1 and (x[last] - after) / (peak - after) > _FOOT:
            last += 1
        return slice(first, last + 1)

    def pulse(self, span: slice) -> Transient:
        """Largest change from the level before."""
        change = self.torque[span] - self._levels(span)[0]
        at = int(np.argmax(np.abs(change)))
        peak, std = float(change[at]), float(self.bound[span][at])
        start, end = self.time[span][[0, -1]].tolist()
        return Transient.on_joint(self.joint, self.run, (start, end, _EDGE), peak, std)

    def _levels(self, core: slice) -> tuple[float, float]:
        """Medians before and after; zero, the usual value, where the stretch ends."""
        step = float(self.time[1] - self.time[0])
        near, far = (round(t / step) for t in _LEVEL)
        before = self.torque[max(core.start - far, 0) : max(core.start - near, 0)]
        after = self.torque[core.stop + near : core.stop + far]
        return tuple(float(np.median(part)) if len(part) else 0.0 for part in (before, after))  # type: ignore[return-value]


def rest_events(
    balance: Balance,
    run: int,
    friction: Array,
    of_load: Array | float = 0.0,
    moving: MovingArm | None = None,
) -> Events:
    """Events of one recording at joints that do not move.

    Args:
        balance: The model along it.
        run: Its number.
        friction: (n,) Coulomb torques; nan where nobody knows [N m].
        of_load: (n,) what friction holds more by the torque that a joint carries.
        moving: What joints that move tell of the model; None: none does.
    """
    robot = balance.robot
    unknown = np.isnan(friction)
    bound = np.where(unknown, FRICTION_SHARE * robot.effort_limits, friction)
    held = bound + np.where(unknown, 0.0, of_load) * np.abs(balance.motion.effort)
    measured = np.flatnonzero(~_unmeasured(balance)).tolist()
    stretches = [rest for j in measured for rest in rests(balance, run, j, held[:, j], moving)]
    cores = [(rest, core) for rest in stretches for core in rest.cores(REST_SHARE)]
    pulses = [rest.pulse(rest.span(core)) for rest, core in cores]
    # what is no more than friction away from what was before creeps: nobody came
    found = [pulse for pulse in pulses if pulse.z > REST_SHARE]
    last = float(balance.arm.times[-1])
    groups = [_felt(robot, first, stretches) for first in _apart(robot, found)]
    named = [event_of(robot, group, None, last) for group in groups]
    possible = [
        _possible(robot, rest, core)
        for rest in stretches
        if unknown[rest.joint]
        for core in rest.cores(0.0, max(_LARGE * np.max(np.abs(rest.torque)), _CLEAR * rest.noise))
        if not any(e.start < rest.time[core][-1] and rest.time[core][0] < e.end for e in named)
    ]
    limits: dict[str, EventLimit | None] = {
        joint: _limit(rest, robot.unit_of('N m', joint))
        for rest in stretches
        for joint in [robot.joints[rest.joint]]
        if not unknown[rest.joint]
    }
    return Events(named=tuple(named), possible=tuple(possible), limits=limits)


def rests(
    balance: Balance, run: int, j: int, friction: Array, moving: MovingArm | None
) -> Iterator[Rest]:
    """All stretches of rest of a joint.

    Args:
        balance: The model along a recording.
        run: Its number.
        j: Number of the joint.
        friction: (N,) torque that its friction holds [N m].
        moving: See `rest_events`.
    """
    arm = balance.arm
    known = arm.is_known
    settled = round(_SETTLED / arm.step)
    labels, count = label(~arm.is_moving[:, j] & known & arm.powered[:, j])
    missed, sensor = arm.in_band(balance.missed[:, j]), own_noise_in_band(balance)
    for k in range(1, count + 1):
        at = np.flatnonzero(labels == k)
        moves = at[0] > 0 and known[at[0] - 1], at[-1] + 1 < len(known) and known[at[-1] + 1]
        first, last = at[0] + settled * moves[0], at[-1] - settled * moves[1]
        if (last - first) * arm.step < _STRETCH:
            continue
        time = arm.times[first : last + 1]
        wrong, std = _of_model(balance, moving, run, j, time)
        x = missed[first : last + 1] - wrong
        near = _reach(arm, len(at), *moves)[first - at[0] : last + 1 - at[0]] * _level(moving, j)
        spread = np.sqrt(std**2 + near**2 + float(sensor[j]) ** 2)
        holds = friction[first : last + 1]
        slack = holds + LISTED / REST_SHARE * std  # its own share takes little noise
        bound = np.maximum(slack, (holds + LISTED * spread) / REST_SHARE)
        x = x - _usual(x, float(np.median(bound)))
        lag = max(1, round(_LAG / arm.step))
        noise = 1.5 * float(np.median(np.abs(x[lag:] - x[:-lag])))
        yield Rest(j, run, time, x, bound, noise)


def _of_model(
    balance: Balance, moving: MovingArm | None, run: int, j: int, time: Array
) -> tuple[Array, Array]:
    """(N,) torque that the model is wrong by, as far as other joints tell, and its deviation.

    Both but for a constant.
    """
    if moving is None:
        return np.zeros(len(time)), np.zeros(len(time))
    columns, rows = moving.rows.columns[run][:, j], balance.row_times
    inside = (rows >= time[0]) & (rows <= time[-1])
    columns = columns - np.mean(columns[inside], axis=0)
    wrong = columns @ moving.beside.coefficients
    return np.interp(time, rows, wrong), np.interp(time, rows, moving.beside.spread(columns))


def _level(moving: MovingArm | None, j: int) -> float:
    """Rms of what the model misses of a joint that moves [N m]."""
    left = np.zeros(0) if moving is None else moving.beside.left_of(j)
    return float(np.sqrt(np.mean(left**2))) if len(left) else 0.0


def _reach(arm: ArmMotion, count: int, before: bool, after: bool) -> Array:
    """(N,) share of what is missed in motion that the filter brings to samples of a rest.

    The largest of all samples farther in: it rings.

    Args:
        arm: The motion.
        count: Number of samples.
        before: Whether the joint moved before.
        after: Whether it does then.
    """
    ended = np.append(np.ones(count), np.zeros(2 * count))
    rings = np.abs(arm.in_band(ended)[count : 2 * count])
    left = np.maximum.accumulate(rings[::-1])[::-1]
    return np.maximum(left * before, left[::-1] * after)


def _unmeasured(balance: Balance) -> BoolArray:
    """(n,) joints without efforts."""
    effort = balance.arm.record.effort
    return np.isnan(effort[0]) if effort is not None else np.ones(balance.robot.n_joints, bool)


def _apart(robot: Robot, found: Sequence[Transient]) -> list[Transient]:
    """The largest pulses at their times and branches."""
    out: list[Transient] = []
    for p in sorted(found, key=lambda p: -p.z):
        if not any(p.overlaps(q) and are_in_line(robot, p.joint, q.joint) for q in out):
            out.append(p)
    return out


def _felt(robot: Robot, first: Transient, stretches: Sequence[Rest]) -> list[Transient]:
    """A pulse, and the change of every other joint at rest that feels the same."""
    others = []
    for rest in stretches:
        if rest.joint == first.joint or rest.time[0] > first.start or rest.time[-1] < first.end:
            continue
        own = slice(*np.searchsorted(rest.time, [first.start, first.end]).tolist())
        pulse = rest.pulse(own)
        if pulse.z > _FELT:
            others.append(replace(pulse, start=first.start, end=first.end))
    out = [first]
    for p in sorted(others, key=lambda p: -p.z):
        if all(are_in_line(robot, p.joint, q.joint) for q in out):
            out.append(p)
    return out


def _limit(rest: Rest, unit: str) -> EventLimit:
    """From where on friction, which may turn from -T to T, leaves enough of a push long enough."""
    needed = (2.0 + REST_SHARE) * float(np.median(rest.bound))
    shares = np.cos(0.5 * np.pi * _SHORTEST / np.array(DURATIONS)) ** 2
    peaks = tuple((needed / shares).tolist())
    return EventLimit(
        duration=DURATIONS[0],
        durations=DURATIONS,
        peaks=peaks,
        unit=unit,
        snr=peaks[0] / float(np.median(rest.bound)),
    )


def _possible(robot: Robot, rest: Rest, core: slice) -> PossibleEvent:
    size, ends = float(np.max(np.abs(rest.torque[core]))), rest.time[core][[0, -1]].tolist()
    times, noise = (ends[0], ends[1], _EDGE), max(rest.noise, 1e-12)
    pulse = Transient.on_joint(rest.joint, rest.run, times, size, noise)
    return possible_of(robot, [pulse], 'friction')


def _usual(values: Array, bound: float) -> float:
    """Middle of the most values that friction can make of one load.

    Args:
        values: (N,) torques of a joint at rest [N m].
        bound: Its Coulomb torque [N m]; infinite where nobody knows.
    """
    x = np.sort(values)
    end = np.searchsorted(x, x + 2.0 * bound, side='right')
    first = int(np.argmax(end - np.arange(len(x))))
    return float(np.median(x[first : end[first]]))

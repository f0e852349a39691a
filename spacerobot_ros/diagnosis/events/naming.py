"""Which pulses of a moving arm are events, which only may be, and why."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from scipy.ndimage import binary_dilation

from ...effects.surroundings.external import ExternalWrench, pulse_shape
from ...estimation.balance.arm_priors import DRY, FRICTION, OF_LOAD, VISCOUS, friction_of
from ...estimation.balance.balance import Balance
from ...model.robot import Robot
from ...types import Array, IntArray
from .contact import Pulse, are_in_line, event_of, last_felt, overlap
from .event import Event, EventLimit, Events, PossibleEvent
from .event_limits import EXPLAINED, LISTED, MIXED, NAMED, RECURS, ROOM, SNR, chance, named_from
from .joint_scan import Pulses
from .moving import DURATIONS, PulseSearch
from .state_function import beside_function
from .states import States

_TOUCHING = 0.5  # s between two pulses that may be one: errors of a start come in a row
_TOGETHER = 0.4  # of the time of both that pulses of one event share
_EDGE = 0.3  # s from an end of the record or a pause, where filters and drives start up
_STARTED = 0.5  # s since a rest, in which friction may still change its side
_STICTION = 2.0  # Coulomb torques that it may do so by
_SHOWN = 0.6  # s: duration of the limit that is shown


class Naming:
    """Events of a search.

    Args:
        search: Its pulses.
    """

    def __init__(self, search: PulseSearch) -> None:
        self._search, self._rows = search, search.rows
        self._joints = self._rows.robot.joints
        spans = [b.arm.times[-1] - b.arm.times[0] for b in self._rows.balances]
        self._seconds = float(sum(spans))
        self._states: dict[int, States] = {}
        self._why = {id(p): self._reason(p) for p in search.found}
        free = [p for p in search.found if not self._why[id(p)]]
        sizes = [beside_function(search, self._states[p.joint], p) for p in free]
        beyond = [z for z in sizes if z >= LISTED]
        self.limit = named_from(beyond, self._seconds / 3600.0)
        self._why |= {id(p): self._unnamed(p, z) for p, z in zip(free, sizes, strict=True)}

    def events(self) -> Events:
        """All of them."""
        named: list[Event] = []
        possible: list[PossibleEvent] = []
        for own in together(self._rows.robot, self._search.found):
            reason = self._spoiled(own[0]) or self._why[id(own[0])]
            if reason:
                possible.append(self._possible(own, reason))
            else:
                named.append(self._event(own))
        unjudged = [self._joints[j] for j in range(len(self._joints)) if not self._explained[j]]
        notes = (
            f'events of {", ".join(unjudged)} are not judged: the model explains less than '
            f'{EXPLAINED:.0%} of the torques there',
        )
        return Events(
            named=tuple(named),
            possible=tuple(possible),
            limits=self._limits(),
            notes=notes if unjudged else (),
        )

    def _reason(self, p: Pulse) -> str:
        """Why a pulse of any size is not named; empty where it may be."""
        if not self._explained[p.joint]:
            return 'unexplained'
        if p.joint not in self._states:
            self._states[p.joint] = States(self._search, p.joint)
        share, distance = self._states[p.joint].visited(p)
        if share > RECURS:
            return 'recurs'
        if self._is_at_edge(p):
            return 'edge'
        if distance > 1.0:
            return 'unvisited'
        if self._is_stiction(p):
            return 'stiction'
        return ''

    def _unnamed(self, p: Pulse, beside: float) -> str:
        """Why a pulse of some z beside a function of the state is not named; empty where it is."""
        if beside >= self.limit:
            return ''
        return 'recurs' if beside < (1.0 - RECURS) * abs(p.z) else 'weak'

    def _is_at_edge(self, p: Pulse) -> bool:
        """Whether a pulse begins or ends where the recording does, or pauses."""
        arm, ends = self._rows.balances[p.run].arm, np.array([p.start, p.end])
        off = np.abs(arm.times[~arm.is_known, None] - ends)
        return bool(ends[0] < arm.times[0] or ends[1] > arm.times[-1] or np.any(off < _EDGE))

    def _spoiled(self, p: Pulse) -> str:
        """Why a pulse is not named that touches in time a large error of the model."""
        wrong = [
            q
            for q in self._search.found
            if _touch(p, q) and self._why[id(q)] in ('recurs', 'unvisited', 'edge')
        ]
        worst = max(wrong, key=lambda q: abs(q.z), default=None)
        return self._why[id(worst)] if worst and abs(worst.z) > MIXED * abs(p.z) else ''

    @cached_property
    def _explained(self) -> list[bool]:
        """Of every joint whether the model explains enough of its torques."""
        out = []
        for joint, scale in zip(self._search.scan.joints, self._rows.scale, strict=False):
            own = joint.kept
            left = own.left(self._search.scan.coefficients)
            total = float(np.sum(own.scale**2) * scale**2)
            out.append(bool(np.sum(left**2) <= (1.0 - EXPLAINED) * total))
        return out

    def _is_stiction(self, p: Pulse) -> bool:
        """Whether a joint that rests, or did, may have changed the side of its friction.

        Not where enough of the pulse is left far from any rest.
        """
        arm = self._rows.balances[p.run].arm
        span = max(1, 2 * round(_STARTED / arm.step) + 1)
        near = binary_dilation(~arm.is_moving[:, p.joint] & arm.is_known, np.ones(span))
        square = pulse_shape((arm.times - p.start) / (p.end - p.start), p.edge) ** 2
        share = float(np.sum(square[~near]) / np.sum(square))
        is_small = abs(p.torque) < _STICTION * self.coulomb(p.joint)
        return share < 1.0 and is_small and abs(p.z) * math.sqrt(share) < NAMED

    def coulomb(self, j: int) -> float:
        """Dry friction of a joint that slides, all that was found of it [N m]."""
        return max(float(self._rows.friction[j]) + self._dry(j), 0.0)

    def of_load(self, j: int) -> float:
        """Dry friction of a joint by the torque that it carries."""
        believed = friction_of(self._rows.balances[0].effects, OF_LOAD, self._joints[j])
        found = self._search.scan.coefficients[self._places(j, OF_LOAD)]
        return max(believed + float(np.sum(found)), 0.0)

    def _dry(self, j: int) -> float:
        """The Coulomb torque that comes closest to all friction found, beside a viscous one.

        Several laws share one friction in any proportion, which nothing bounds here.
        """
        rows, scan = self._rows, self._search.scan
        line = np.concatenate([self._places(j, law) for law in (DRY, VISCOUS)])
        columns = scan.joints[j].kept.rows.columns
        if len(line) < 2 or not len(columns):
            return 0.0
        every = zip(rows.candidates, rows.places, strict=True)
        laws = np.concatenate([at for c, at in every if c.kind.id in FRICTION])
        torque = columns[:, laws] @ scan.coefficients[laws]
        return float(np.linalg.lstsq(columns[:, line], torque)[0][0])

    def _places(self, j: int, law: str) -> IntArray:
        """Columns of a law at a joint."""
        every = zip(self._rows.candidates, self._rows.places, strict=True)
        own = [at for c, at in every if c.key == (law, self._joints[j])]
        return np.concatenate([*own, np.zeros(0, dtype=int)])

    def _event(self, own: Sequence[Pulse]) -> Event:
        cells = sum(2.0 / d for d in DURATIONS) * self._seconds * len(self._joints)
        last = float(self._rows.balances[own[0].run].arm.times[-1])
        felt = _felt(own)
        event = event_of(self._rows.robot, felt, chance(own[0].z, cells), last)
        (link,) = last_felt(self._rows.robot, [p.joint for p in felt])
        wrench = wrench_of(self._search, own[0], link) if len(felt) > 1 else None
        if wrench is None:
            return event
        return replace(event, wrench=wrench, applied=(applied_wrench(own[0], link, wrench),))

    def _possible(self, own: Sequence[Pulse], reason: str) -> PossibleEvent:
        joints = tuple(self._joints[p.joint] for p in _felt(own))
        first = own[0]
        return PossibleEvent(
            start=first.start,
            end=first.end,
            joints=joints,
            z=abs(first.z),
            reason=reason,
            recording=first.run,
        )

    def _limits(self) -> dict[str, EventLimit | None]:
        snr = max(SNR, ROOM * self.limit)
        out: dict[str, EventLimit | None] = {}
        for j, name in enumerate(self._joints):
            peaks = tuple(snr * self._search.usual_std(j, d) for d in DURATIONS)
            limit = EventLimit(
                duration=_SHOWN,
                durations=DURATIONS,
                peaks=peaks,
                unit=self._rows.robot.unit_of('N m', name),
                snr=snr,
            )
            out[name] = limit if self._explained[j] and math.isfinite(limit.peak) else None
        return out


def _felt(own: Sequence[Pulse]) -> list[Pulse]:
    """The largest pulse of each joint, from the base on."""
    best: dict[int, Pulse] = {}
    for p in own:
        best.setdefault(p.joint, p)
    return [best[j] for j in sorted(best)]


def _touch(p: Pulse, q: Pulse) -> bool:
    """Whether two pulses of a recording touch in time, whatever their joints."""
    near = p.start < q.end + _TOUCHING and q.start < p.end + _TOUCHING
    return p.run == q.run and near


def together(robot: Robot, group: Sequence[Pulse]) -> list[list[Pulse]]:
    """Pulses at the same time on one branch, the largest first: one event each."""
    out: list[list[Pulse]] = []
    for p in sorted(group, key=lambda p: -abs(p.z)):
        for own in out:
            in_line = all(are_in_line(robot, p.joint, q.joint) for q in own)
            if in_line and _shared(p, own[0]) > _TOGETHER:
                own.append(p)
                break
        else:
            out.append([p])
    return out


def _shared(p: Pulse, q: Pulse) -> float:
    """Share of the time of two pulses that both take."""
    if not overlap(p, q):
        return 0.0
    both = min(p.end, q.end) - max(p.start, q.start)
    return both / (max(p.end, q.end) - min(p.start, q.start))


NAMES = tuple(f'{what}_{axis}' for what in ('force', 'torque') for axis in 'xyz')

Wrench = Mapping[str, tuple[float, float]]
"""Largest force [N] and torque [N m] at a link's origin in its frame, with deviations."""


def wrench_of(search: PulseSearch, first: Pulse, link: str) -> Wrench | None:
    """The wrench at a link; None where joints tell less than all of it.

        tau_j = sum_k (J' e_k)_j w_k,    w = (M' M)^-1 M' (tau / std),  M = J' / std,

    with the joints' torques from outside by one template at the event's time, those that do not
    feel it included, and J of the last link that does: a contact beyond it has the same force
    there, and a torque that counts its lever.

    Args:
        search: The recordings.
        first: The event's largest pulse.
        link: The last that feels it.
    """
    columns = _transposed_jacobian(search.rows.balances[first.run], first, link)
    inboard = np.flatnonzero(np.any(columns != 0.0, axis=1)).tolist()
    duration = first.end - first.start
    shape = ([0.5 * (first.start + first.end)], [duration], [first.edge])
    pulse = Pulses(*(np.array(x) for x in shape))
    torques, stds = [], []
    for j in inboard:
        found = search.scan.test(j, first.run, pulse)
        torques.append(found.torque[0])
        stds.append(found.std[0] * search.colour(j, duration))
    seen = np.isfinite(torques)
    weights = 1.0 / np.array(stds)[seen]
    matrix = columns[inboard][seen] * weights[:, None]
    if np.linalg.matrix_rank(matrix) < len(NAMES):
        return None
    covariance = np.linalg.inv(matrix.T @ matrix)
    values = covariance @ (matrix.T @ (np.array(torques)[seen] * weights))
    deviations = np.sqrt(np.diag(covariance))
    pairs = zip(values.tolist(), deviations.tolist(), strict=True)
    return dict(zip(NAMES, pairs, strict=True))


def applied_wrench(pulse: Pulse, link: str, wrench: Wrench) -> ExternalWrench:
    """As an effect, with the times of a pulse."""
    sizes = {name: value for name, (value, _) in wrench.items()}
    return ExternalWrench(name=f'event_{link}', where=link, values=pulse.times | sizes)


def _transposed_jacobian(balance: Balance, pulse: Pulse, link: str) -> Array:
    """(n, 6) torques on the joints of a unit of each number, in the middle of a pulse."""
    motion = balance.motion
    at = int(np.argmin(np.abs(motion.time - 0.5 * (pulse.start + pulse.end))))
    none = dict.fromkeys(NAMES, (0.0, 0.0))
    units = [applied_wrench(pulse, link, {**none, name: (1.0, 0.0)}) for name in NAMES]
    hidden = np.zeros((len(motion), 0))
    return np.column_stack([unit.force(motion, hidden)[at, 6:] for unit in units])

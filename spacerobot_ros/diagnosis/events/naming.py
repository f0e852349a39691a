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
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance
from ...model.robot import Robot
from ...types import Array, IntArray
from ..limits import EVENT, EXPLAINED, LISTED, SUSPECTED
from .event import Event, EventLimit, Events, PossibleEvent
from .joint_templates import DURATIONS, Arm, JointTemplates
from .matched import MatchedFilter
from .naming_rule import chance, named_from
from .states import States
from .transient import Shapes, Transient, are_in_line, event_of, last_felt, possible_of
from .transient_search import TransientSearch

_TOUCHING = 0.5  # s between two pulses that may be one: errors of a start come in a row
_TOGETHER = 0.4  # of the time of both that pulses of one event share
_EDGE = 0.3  # s from an end of the record or a pause, where filters and drives start up
_STARTED = 0.5  # s since a rest, in which friction may still change its side
_STICTION = 2.0  # Coulomb torques that it may do so by
_SHOWN = 0.6  # s: duration of the limit that is shown


class MovingArm:
    """Events of the joints of an arm that move.

    Whatever might be a pulse is one until the level of the rest is known. Where none is large even
    so, only what is listed is: a quiet machine's level is that of all its rows.

    Args:
        rows: The recordings.

    Attributes:
        beside: What lasts, and all pulses.
        found: Pulses, the largest first.
        limit: z from which one is named.
    """

    def __init__(self, rows: ArmRows) -> None:
        self.rows, templates = rows, JointTemplates.of(rows)
        search = TransientSearch(templates, SUSPECTED)
        if any(p.z >= EVENT for p in search.found):
            search = TransientSearch(
                templates.about(search.raw).rescaled(search.raw), LISTED, search.raw
            )
        else:
            search = TransientSearch(templates, LISTED)
        self._search, self.beside = search, Arm(search.templates, search.raw)
        self._joints = rows.robot.joints
        self._seconds = float(sum(b.arm.times[-1] - b.arm.times[0] for b in rows.balances))
        self.found = search.found
        self._states = {j: States(rows, j, self.beside) for j in {p.joint for p in self.found}}
        self._why = {p: self._reason(p) for p in self.found}
        free = [p for p, why in self._why.items() if not why]
        sizes = [self.beside_states(p) for p in free]
        self.limit = named_from([z for z in sizes if z >= LISTED], self._seconds / 3600.0)
        for p, z in zip(free, sizes, strict=True):
            if z < self.limit:
                self._why[p] = 'recurs' if z < 0.5 * p.z else 'weak'

    def events(self) -> Events:
        """All of them."""
        named: list[Event] = []
        possible: list[PossibleEvent] = []
        for own in together(self.rows.robot, self.found):
            if reason := self._spoiled(own[0]) or self._why[own[0]]:
                possible.append(possible_of(self.rows.robot, _felt(own), reason))
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

    def _reason(self, p: Transient) -> str:
        """Why a pulse of any size is not named; empty where it may be."""
        if not self._explained[p.joint]:
            return 'unexplained'
        share, distance = self._states[p.joint].visited(p)
        if share > 0.5:
            return 'recurs'
        if self._is_at_edge(p):
            return 'edge'
        if distance > 1.0:
            return 'unvisited'
        return 'stiction' if self._is_stiction(p) else ''

    def beside_states(self, p: Transient) -> float:
        """Size of a pulse beside a function of its joint's state; at most what it is without."""
        others = Arm(self._search.templates, self._search.without([p]))
        z = self._states[p.joint].beside_function(p, others)
        return min(p.z, z / self._search.colour(p.joint, p.duration))

    def _is_at_edge(self, p: Transient) -> bool:
        """Whether a pulse begins or ends where the recording does, or pauses."""
        arm, ends = self.rows.balances[p.run].arm, np.array([p.start, p.end])
        off = np.abs(arm.times[~arm.is_known, None] - ends)
        return bool(ends[0] < arm.times[0] or ends[1] > arm.times[-1] or np.any(off < _EDGE))

    def _spoiled(self, p: Transient) -> str:
        """Why a pulse is not named that touches in time a large error of the model."""
        wrong = [
            q
            for q in self.found
            if p.overlaps(q, _TOUCHING) and self._why[q] in ('recurs', 'unvisited', 'edge')
        ]
        worst = max(wrong, key=lambda q: q.z, default=None)
        return self._why[worst] if worst is not None and worst.z > 0.5 * p.z else ''

    @cached_property
    def _explained(self) -> list[bool]:
        """Of every joint whether the model explains enough of its torques."""
        out = []
        for j, scale in enumerate(self.rows.scale[: len(self._joints)]):
            total = float(np.sum(self.beside.templates.sets[j].scale ** 2) * scale**2)
            left = float(np.sum(self.beside.left_of(j) ** 2))
            out.append(left <= (1.0 - EXPLAINED) * total)
        return out

    def _is_stiction(self, p: Transient) -> bool:
        """Whether a joint that rests, or did, may have changed the side of its friction.

        Not where enough of the pulse is left far from any rest.
        """
        arm = self.rows.balances[p.run].arm
        span = max(1, 2 * round(_STARTED / arm.step) + 1)
        near = binary_dilation(~arm.is_moving[:, p.joint] & arm.is_known, np.ones(span))
        square = pulse_shape((arm.times - p.start) / (p.end - p.start), p.edge) ** 2
        share = float(np.sum(square[~near]) / np.sum(square))
        is_small = abs(p.value[0]) < _STICTION * self.coulomb(p.joint)
        return share < 1.0 and is_small and p.z * math.sqrt(share) < EVENT

    def coulomb(self, j: int) -> float:
        """Dry friction of a joint that slides, all that was found of it [N m]."""
        return max(float(self.rows.friction[j]) + self._dry(j), 0.0)

    def of_load(self, j: int) -> float:
        """Dry friction of a joint by the torque that it carries."""
        believed = friction_of(self.rows.balances[0].effects, OF_LOAD, self._joints[j])
        found = self.beside.coefficients[self._places(j, OF_LOAD)]
        return max(believed + float(np.sum(found)), 0.0)

    def _dry(self, j: int) -> float:
        """The Coulomb torque that comes closest to all friction found, beside a viscous one.

        Several laws share one friction in any proportion, which nothing bounds here.
        """
        rows = self.rows
        line = np.concatenate([self._places(j, law) for law in (DRY, VISCOUS)])
        columns = self.beside.templates.sets[j].own.columns
        if len(line) < 2 or not len(columns):
            return 0.0
        every = zip(rows.candidates, rows.places, strict=True)
        laws = np.concatenate([at for c, at in every if c.kind.id in FRICTION])
        torque = columns[:, laws] @ self.beside.coefficients[laws]
        return float(np.linalg.lstsq(columns[:, line], torque)[0][0])

    def _places(self, j: int, law: str) -> IntArray:
        """Columns of a law at a joint."""
        every = zip(self.rows.candidates, self.rows.places, strict=True)
        own = [at for c, at in every if c.key == (law, self._joints[j])]
        return np.concatenate([*own, np.zeros(0, dtype=int)])

    def _event(self, own: Sequence[Transient]) -> Event:
        cells = sum(2.0 / d for d in DURATIONS) * self._seconds * len(self._joints)
        first, felt = own[0], _felt(own)
        last = float(self.rows.balances[first.run].arm.times[-1])
        event = event_of(self.rows.robot, felt, chance(first.z, cells), last)
        (link,) = last_felt(self.rows.robot, [p.joint for p in felt])
        wrench = self._wrench(first, link) if len(felt) > 1 else None
        if wrench is None:
            return event
        return replace(event, wrench=wrench, applied=(applied_wrench(first, link, wrench),))

    def _limits(self) -> dict[str, EventLimit | None]:
        out: dict[str, EventLimit | None] = {}
        for j, name in enumerate(self._joints):
            stds = [float(self._search.usual_std(j, d)[0]) for d in DURATIONS]
            unit = self.rows.robot.unit_of('N m', name)
            limit = EventLimit.of(self.limit, _SHOWN, DURATIONS, stds, unit)
            out[name] = limit if self._explained[j] and math.isfinite(limit.peak) else None
        return out

    def _wrench(self, first: Transient, link: str) -> Wrench | None:
        """The wrench at a link; None where joints tell less than all of it.

            tau_j = sum_k (J' e_k)_j w_k,    w = (M' M)^-1 M' (tau / std),  M = J' / std,

        with the joints' torques from outside by one template at the event's time, those that do
        not feel it included, and J of the last link that does: a contact beyond it has the same
        force there, and a torque that counts its lever.

        Args:
            first: The event's largest pulse.
            link: The last that feels it.
        """
        columns = _transposed_jacobian(self.rows.balances[first.run], first, link)
        rows, torques = [], []
        for j in np.flatnonzero(np.any(columns != 0.0, axis=1)).tolist():
            here = [q for q in self.found if q.joint == j and q.overlaps(first)]
            others = MatchedFilter(self._search.templates, self._search.without(here))
            found = others.test(j, first.run, Shapes.of(first))
            if found.z[0]:
                std = found.covariance[0, 0, 0] ** 0.5 * self._search.colour(j, first.duration)
                rows.append(columns[j] / std)
                torques.append(found.value[0, 0] / std)
        matrix = np.array(rows)
        if len(rows) < len(NAMES) or np.linalg.matrix_rank(matrix) < len(NAMES):
            return None
        covariance = np.linalg.inv(matrix.T @ matrix)
        values = covariance @ (matrix.T @ np.array(torques))
        deviations = np.sqrt(np.diag(covariance))
        pairs = zip(values.tolist(), deviations.tolist(), strict=True)
        return dict(zip(NAMES, pairs, strict=True))


def _felt(own: Sequence[Transient]) -> list[Transient]:
    """The largest pulse of each joint, from the base on."""
    best: dict[int, Transient] = {}
    for p in own:
        best.setdefault(p.joint, p)
    return [best[j] for j in sorted(best)]


def together(robot: Robot, group: Sequence[Transient]) -> list[list[Transient]]:
    """Pulses at the same time on one branch, the largest first: one event each."""
    out: list[list[Transient]] = []
    for p in sorted(group, key=lambda p: -p.z):
        for own in out:
            in_line = all(are_in_line(robot, p.joint, q.joint) for q in own)
            if in_line and _shared(p, own[0]) > _TOGETHER:
                own.append(p)
                break
        else:
            out.append([p])
    return out


def _shared(p: Transient, q: Transient) -> float:
    """Share of the time of two pulses that both take."""
    both = min(p.end, q.end) - max(p.start, q.start)
    return both / (max(p.end, q.end) - min(p.start, q.start)) if p.run == q.run else 0.0


NAMES = tuple(f'{what}_{axis}' for what in ('force', 'torque') for axis in 'xyz')

Wrench = Mapping[str, tuple[float, float]]
"""Largest force [N] and torque [N m] at a link's origin in its frame, with deviations."""


def applied_wrench(pulse: Transient, link: str, wrench: Wrench) -> ExternalWrench:
    """As an effect, with the times of a pulse."""
    sizes = {name: value for name, (value, _) in wrench.items()}
    return ExternalWrench(name=f'event_{link}', where=link, values=pulse.times | sizes)


def _transposed_jacobian(balance: Balance, pulse: Transient, link: str) -> Array:
    """(n, 6) torques on the joints of a unit of each number, in the middle of a pulse."""
    motion = balance.motion
    at = int(np.argmin(np.abs(motion.time - pulse.middle)))
    none = dict.fromkeys(NAMES, (0.0, 0.0))
    units = [applied_wrench(pulse, link, {**none, name: (1.0, 0.0)}) for name in NAMES]
    hidden = np.zeros((len(motion), 0))
    return np.column_stack([unit.force(motion, hidden)[at, 6:] for unit in units])

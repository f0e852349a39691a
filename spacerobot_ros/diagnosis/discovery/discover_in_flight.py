"""What the leftover of a robot whose sensors' noise is known depends on: joints and base."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect, Key
from ...effects.laws.grammar import FORMS
from ...effects.laws.law_inputs import AXES, base_axes
from ...effects.laws.learned_torque import LearnedTorque, law_at
from ...effects.motion import Motion
from ...estimation.fit import Fit
from ...estimation.inference.evidence import Gram, chi_square_tail
from ...estimation.refit import refine
from ...estimation.scaling import PROPORTIONAL
from ...model.machine import machine_of
from ...model.robot import Robot
from ...types import Array
from ..answer.cause import Cause
from ..answer.result import Diagnosis, Leftover
from ..limits import CHANCE, LARGEST_LAW, MISFIT, OBVIOUS
from ..orders.orders import find_orders, wheel_orders
from .channel_laws import HeldLaw, channel_name, laws_of, leftover_of, leftover_without
from .discover import feeds_energy
from .flight_channels import Component, FlightChannel, FlightRows
from .in_place import instead_of
from .law_search import Winner
from .possible_laws import ACROSS, SENSOR


def discover_in_flight(
    answer: Diagnosis, fit: Fit, report: Callable[[str, float], None]
) -> Diagnosis:
    """The answer with laws of what its causes leave, the causes fitted beside them.

    Of a model that fits only laws in the place of causes are asked; where those are too small to
    matter, so are the laws, and the verdict stays. Lines of wheels are asked of all, as they may
    be above what the fit follows, or too small for a test of all that is left.

    Args:
        answer: Of the causes.
        fit: Of its causes.
        report: Called with what is being done and the share done.
    """
    report('asking what the leftover depends on', 0.95)
    found, record = _discovered(answer, fit), fit.run.record
    if found.orders is not None or record.wheels is None:
        return found
    lines = wheel_orders(record, _units(fit.run.robot))
    return replace(found, orders=tuple(order for own in lines.values() for order in own))


def _units(robot: Robot) -> dict[str, str]:
    """Of the efforts, by joint."""
    return {joint: robot.unit_of('N m', joint) for joint in robot.arm}


def _discovered(answer: Diagnosis, fit: Fit) -> Diagnosis:
    """The answer with laws."""
    places, is_refused = _places(FlightRows(fit)), answer.fit_p is None or answer.fit_p < MISFIT
    if not places:
        return answer
    instead = instead_of(fit, places, is_refused=is_refused)
    if instead:
        spots = {place: it for some in instead.values() for place, it in some.items()}
        flight, gone = FlightRows(fit, tuple(instead)), _names(fit.causes[i] for i in instead)
        found = _with_discoveries(_without(answer, gone), flight, places if is_refused else spots)
        learned = {entry.applied.where for entry in found.leftover or () if entry.applied}
        if all(learned.intersection(some) for some in instead.values()):
            is_small = not (is_refused or gone & _names(c.applied for c in answer.causes))
            return replace(found, verdict=answer.verdict) if is_small else found
    return _with_discoveries(answer, FlightRows(fit), places) if is_refused else answer


def _names(effects: Iterable[Effect]) -> set[Key]:
    return {e.key for e in effects}


def _without(answer: Diagnosis, gone: Collection[Key]) -> Diagnosis:
    """The answer without some causes."""
    causes, minor = (
        tuple(c for c in every if c.applied.key not in gone)
        for every in (answer.causes, answer.minor)
    )
    return replace(answer, causes=causes, minor=minor)


def _with_discoveries(
    answer: Diagnosis, flight: FlightRows, places: Mapping[str, Component]
) -> Diagnosis:
    """The answer with laws of what is left at some places.

    Coefficients are those beside errors of masses and inertias. Where these take most of a law,
    as of a slow torque on the base, it may be worse so than the causes in whose place it stands,
    as nobody applies the errors: then it is fitted without them.
    """
    channel, robot = FlightChannel(flight, places), flight.motion.robot
    held, rest = laws_of(channel)
    first = max((it.step.margin for it in held), default=0.0)
    held = [it for it in held if it.step.margin > OBVIOUS * first]
    answer = replace(answer, orders=find_orders([flight.fit.run.record], _units(robot)))
    found = answer
    for is_tolerant in (True, False):
        fitted = _fitted(channel, held, rest, is_tolerant=is_tolerant)
        entries, laws = _entries(answer, channel, fitted)
        entries += _without_laws(channel, entries, rest)
        slow = {channel_name(j) for j in robot.arm if flight.has_one_speed(j)}
        entries = [replace(entry, one_speed=entry.channel in slow) for entry in entries]
        found = replace(answer, leftover=tuple(sorted(entries, key=lambda entry: entry.channel)))
        if not any(entry.form for entry in entries):
            return found
        if not laws:
            return replace(found, verdict='partly_explained')
        found = _with_laws(found, flight, laws)
        if any(entry.applied for entry in found.leftover or ()):
            return found
    return found


def _entries(
    answer: Diagnosis, channel: FlightChannel, fitted: Sequence[tuple[HeldLaw, Array, Array]]
) -> tuple[list[Leftover], list[LearnedTorque]]:
    """Entries of laws with coefficients and deviations, and the torques among them."""
    entries, laws, motion = [], [], channel.flight.motion
    for it, values, spread in fitted:
        law = None if it.law.kind == SENSOR else _torque_law(channel, it, values)
        if law is not None and feeds_energy(law, [motion]):
            law = replace(law, kind='external') if corrected_by(law, _known(answer)) else None
        entry = leftover_of(it, values, spread, motion.robot, applied=law, is_of_several=False)
        entries.append(entry)
        laws += [] if law is None else [law]
    return entries, laws


def _without_laws(
    channel: FlightChannel, entries: Sequence[Leftover], rest: Sequence[Winner]
) -> list[Leftover]:
    """Entries of joints and axes without a law."""
    done, joints = {entry.channel for entry in entries}, channel.flight.motion.robot.joints
    out = []
    for place in (p for p, component in channel.components.items() if isinstance(component, int)):
        if channel_name(place) not in done:
            own = [step for step in rest if step.law.place == place]
            out.append(leftover_without(place, own[0] if own else None, joints))
    return out


def _with_laws(answer: Diagnosis, flight: FlightRows, laws: list[LearnedTorque]) -> Diagnosis:
    """The causes with the values that they have beside the laws, where these are worth it."""
    fit = flight.fit
    beside = [e for i, e in enumerate(fit.causes) if i not in flight.gone]
    extended = refine(fit.run, [*beside, *laws])
    moved = {e.key: e for e in extended.causes}
    causes = tuple(
        replace(
            cause,
            applied=now,
            parameters={
                name: replace(e, value=now.values[name]) for name, e in cause.parameters.items()
            },
        )
        for cause in _known(answer)
        for now in [moved.get(cause.applied.key, cause.applied)]
    )
    entries, gone = [], []
    for entry in answer.leftover or ():
        law, own = entry.applied, []
        if isinstance(law, LearnedTorque) and law.kind == 'external':
            own = corrected_by(law, causes)
        entries.append(with_friction(entry, own, extended.rows.motion) if own else entry)
        gone += own
    lost = sum(e.applied is not None for e in answer.leftover or ())
    lost -= sum(e.applied is not None for e in entries)
    if extended.misfit >= fit.misfit or lost:
        leftover = tuple(replace(entry, applied=None) for entry in answer.leftover or ())
        return replace(answer, verdict='partly_explained', leftover=leftover)
    faded = _faded(flight, extended, laws)
    gone += [c for c in causes if c.applied in faded]
    kept, minor = (
        tuple(c for c in causes if c not in gone and c.relevant == matters)
        for matters in (True, False)
    )
    return replace(
        answer, verdict='partly_explained', causes=kept, minor=minor, leftover=tuple(entries)
    )


def _known(answer: Diagnosis) -> tuple[Cause, ...]:
    """What was fitted beside laws: causes that matter, and those too small to."""
    return (*answer.causes, *answer.minor)


def _faded(flight: FlightRows, extended: Fit, laws: Sequence[LearnedTorque]) -> list[Effect]:
    """The causes that beside laws are by chance as large as they are, or tell next to nothing.

    What was named for a law, as the best that the catalogue has, is none beside it.

    Args:
        flight: With the causes alone.
        extended: With the laws.
        laws: Of any size.
    """
    every, beside = _squares(flight.fit, ()), _squares(extended, laws)
    alone = [squares for i, squares in enumerate(every) if i not in flight.gone]
    return [
        cause
        for cause, before, (square, numbers) in zip(extended.causes, alone, beside, strict=False)
        if square < OBVIOUS * before[0] or chi_square_tail(square, numbers) > CHANCE
    ]


def _squares(fit: Fit, laws: Sequence[LearnedTorque]) -> list[tuple[float, int]]:
    """How far from nothing each cause is, squared, by its own spread; and its numbers."""
    motion, moved = fit.rows.motion, fit.tangents
    forces = [law.force(motion, law.driven(motion)) for law in laws]
    if forces:
        own = fit.rows.whitened(np.stack(forces, axis=2), {})
        moved = moved - own @ np.linalg.lstsq(own, moved, rcond=None)[0]
    out = []
    for i in sorted({i for i, _ in fit.free}):
        at = [k for k in fit.own(i) if fit.free[k][1].role in PROPORTIONAL]
        others = np.setdiff1d(np.arange(moved.shape[1]), at)
        gram = Gram.of(moved[:, [*others, *at]], np.zeros(len(moved)))
        known = gram.without(len(others), fit.precision[others] + 1e-12).matrix
        out.append((float(fit.offsets[at] @ known @ fit.offsets[at]), len(at)))
    return out


def _places(flight: FlightRows) -> dict[str, Component]:
    """Joints with a torque, axes of a free base and the whole of it, channels of sensors."""
    robot, run = flight.motion.robot, flight.fit.run
    out: dict[str, Component] = {p: 3 + k for k, p in enumerate(base_axes(robot))}
    if out:
        out[robot.base_link] = slice(3, 6)
    if run.record.effort is not None:
        lacking = run.record.joints.without_effort if run.record.joints else ()
        out |= {j: 6 + robot.joints.index(j) for j in robot.arm if j not in lacking}
    return out | dict.fromkeys(flight.sensors)


def _fitted(
    channel: FlightChannel, held: Sequence[HeldLaw], rest: Sequence[Winner], *, is_tolerant: bool
) -> list[tuple[HeldLaw, Array, Array]]:
    """Laws, their coefficients beside all else that won, and standard deviations of these."""
    if not held:
        return []
    steps = [*(it.step for it in held), *(step for step in rest if not step.is_law)]
    columns = np.concatenate([step.columns for step in steps], axis=1)
    level = channel.fitted(columns, is_tolerant=is_tolerant)
    ends = np.cumsum([0, *(it.step.columns.shape[1] for it in held)]).tolist()
    out: list[tuple[HeldLaw, Array, Array]] = []
    for it, (a, b) in zip(held, pairwise(ends), strict=True):
        ways = np.eye(b - a) if it.step.ways is None else it.step.ways
        values = ways @ level.coefficients[a:b]
        spread = np.sqrt(np.diag(ways @ level.covariance[a:b, a:b] @ ways.T))
        out += _by_axis(it, values, spread) if it.law.form is ACROSS else [(it, values, spread)]
    return out


def _by_axis(it: HeldLaw, values: Array, spread: Array) -> list[tuple[HeldLaw, Array, Array]]:
    """The torque of a moment in a field as three laws: each a sum of the entries of R_WB."""
    sign = np.cross(np.eye(3)[:, None, :], np.eye(3)[None, :, :])  # (j, k, i) of e_j x e_k
    out = []
    for i, axis in enumerate(AXES):
        place = f'{it.place}/{axis}'
        law = replace(it.law, form=FORMS['sum of 9'], place=place)
        # entry l k of R_WB, by m_j b_l
        own = np.einsum('jk,jl->lk', sign[:, :, i], values.reshape(3, 3))
        std = np.einsum('jk,jl->lk', np.abs(sign[:, :, i]), spread.reshape(3, 3))
        out.append((replace(it, place=place, law=law), own.ravel(), std.ravel()))
    return out


def _torque_law(channel: FlightChannel, it: HeldLaw, values: Array) -> LearnedTorque:
    """The law as it is simulated, within the range of the data."""
    torque = channel.law_columns(it.law) @ values
    return law_at(
        name=f'learned_torque_{it.place.replace("/", "_")}',
        where=it.place,
        values={},
        form=it.law.form,
        inputs=it.law.inputs,
        coefficients=tuple(values.tolist()),
        range=channel.ranges(it.law),
        limit=max(LARGEST_LAW * float(np.max(np.abs(torque))), math.ulp(1.0)),
        kind=it.law.kind,
        options=dict(it.law.options),
        machine=machine_of(channel.flight.motion.robot.urdf),
    )


_TERMS = {'joint_coulomb_friction': 'sign(x)', 'joint_viscous_friction': 'x'}
"""Simple friction as terms of a law of the joint's rate."""


def corrected_by(law: LearnedTorque, causes: Sequence[Cause]) -> list[Cause]:
    """Simple friction that a law of the joint's own rate has all of as terms."""
    own = [c for c in causes if c.applied.where == law.where and c.applied.id in _TERMS]
    is_of_rate = law.inputs == (f'rate/{law.where}',)
    terms = law.form.name.split(', ') if is_of_rate else ()
    return own if all(_TERMS[c.applied.id] in terms for c in own) else []


def with_friction(entry: Leftover, friction: Sequence[Cause], motion: Motion) -> Leftover:
    """What is said of a law, with friction that it corrects; not applied where it still pushes.

    Alone it pushes where the joint has less friction than is named, so that no controller could
    feed it forward: friction of one direction is named as half of it in both. Whole it takes
    energy.
    """
    law = entry.applied
    if not isinstance(law, LearnedTorque):
        return entry
    terms, whole = law.form.name.split(', '), np.array(law.coefficients)
    for applied in (c.applied for c in friction):
        whole[terms.index(_TERMS[applied.id])] -= next(iter(applied.values.values()))
    free = replace(law, coefficients=tuple(whole.tolist()), limit=math.inf, kind='external')
    largest = float(np.max(np.abs(free.torque(motion, np.zeros((len(motion), 0))))))
    law = replace(free, limit=LARGEST_LAW * largest, kind='dissipative')
    if feeds_energy(law, [motion]):
        return replace(entry, applied=None)
    pairs = zip(entry.coefficients, law.coefficients, strict=True)
    values = tuple(replace(c, value=value) for c, value in pairs)
    return replace(entry, applied=law, kind=law.kind, coefficients=values)

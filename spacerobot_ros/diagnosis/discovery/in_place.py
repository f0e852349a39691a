"""Causes of a flight that stand for a law: the best that the catalogue has for it, and no more.

Viscous friction explains most of a drag, a constant torque most of one that follows the attitude.
The test of fit is of all that is left and does not see what they leave of it; the likelihood of
the law in their place does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from ...estimation.fit import Fit
from .arm_channels import PARTLY_SEEN, REPLACEABLE
from .channel_laws import laws_of, may_be_named
from .discovery_limits import DEAD_HEAT, MARGIN
from .flight_channels import Component, FlightChannel, FlightRows
from .law_search import worth

_OF_JOINTS = {
    **REPLACEABLE,
    'joint_viscous_friction': 0.0,
    'joint_coulomb_friction': 1.0,
    'joint_asymmetric_friction': 2.0,
    'joint_load_friction': 2.0,
    'joint_stribeck_friction': 2.5,
    'joint_friction_curvature': 2.5,
    'joint_presliding_friction': 3.0,
}
_WHEELS = {'servicer_wheel_momentum_error': 0.0, 'target_wheel_momentum': 0.0}
"""Of momenta, whose torque h x omega is slow, too: beside a torque that is constant in inertial
space they stood for one that follows the attitude, which alone was 15 nats ahead of both."""
_OF_BASE = {
    'external_torque_body': 0.0,
    'external_torque_inertial': 3.0,
    'gravity_gradient': 3.0,
    **_WHEELS,
}
PRICES: Mapping[str, float] = MappingProxyType({**_OF_JOINTS, **_OF_BASE})
"""Causes that are a form of the grammar, and their prices there [nats]."""
_OF_THEMSELVES = {
    'joint_load_friction': ('|y| sign(x)',),
    'joint_presliding_friction': ('play(x)', 'dahl(x)'),
}
"""Forms that are one cause's own. Its numbers are free among all that a channel tolerates, those
of the law are priced: beside the true friction with a history, at nine motions and displacements,
its own form was 2 to 7 nats ahead."""


def instead_of(
    fit: Fit, places: Mapping[str, Component], *, is_refused: bool
) -> dict[int, Mapping[str, Component]]:
    """Numbers of the causes in whose place laws explain more, and the places of these laws.

    Fewer laws than causes, or one, ahead by all prices: of a model that fits as far as two causes
    are told apart, unless they are the causes' own forms, else as far as a law must be of chance.
    The same holds against the causes' forms as laws in that place: both comparisons have priors of
    their own, which friction of two numbers lost by 6.6 nats to a square root that as a law was
    ahead of it by 4.8. A ripple of which the motion shows no whole period nobody has seen: laws
    need not be ahead of it, as a polynomial goes on where such a sine may be anything (a
    stiffening spring, of a harmonic of 2.6: R2 -128 along another motion, 0.80 by the polynomial
    that was 2.7 nats ahead).

    Args:
        fit: Of the causes.
        places: Where laws may be.
        is_refused: Whether it does not fit, so that laws beside its causes are asked, too.
    """
    out: dict[int, Mapping[str, Component]] = {}
    flight = FlightRows(fit)
    for choices, some in _groups(fit, places):
        channel = FlightChannel(flight, some, {})
        beside = [it.step for it in laws_of(channel)[0]] if is_refused else []
        known = worth(channel, beside)
        every = ((_ahead(fit, channel, own, is_refused=is_refused), own) for own in choices)
        ahead, best = max(every)
        needed = MARGIN if is_refused else DEAD_HEAT
        if ahead - known > (0.0 if all(_is_part(fit, i) for i in best) else needed):
            out |= dict.fromkeys(best, some)
    return out


def _ahead(fit: Fit, channel: FlightChannel, own: tuple[int, ...], *, is_refused: bool) -> float:
    """What laws in the place of some causes are worth, less than nothing where they are none.

    With the prices of these causes, which the model with them has not paid [nats].
    """
    other = channel.without(own)
    laws = laws_of(other)[0]
    if not 0 < len(laws) < max(len(own), 2) or any(map(may_be_named, laws)):
        return -math.inf
    same = {form for i in own for form in _OF_THEMSELVES.get(fit.causes[i].id, ())}
    if not is_refused and all(it.law.form.name in same for it in laws):
        return -math.inf
    price = sum(PRICES[fit.causes[i].id] for i in own)
    return worth(other, [it.step for it in laws]) + price


def _is_part(fit: Fit, i: int) -> bool:
    """Whether a cause is a ripple of which the motion shows less than a period."""
    cause, motion = fit.causes[i], fit.rows.motion
    if cause.id != PARTLY_SEEN:
        return False
    way = float(np.ptp(motion.q[:, motion.column(cause.where)]))
    return abs(cause.values['harmonic']) * way < 2.0 * math.pi


def _groups(
    fit: Fit, places: Mapping[str, Component]
) -> Iterator[tuple[list[tuple[int, ...]], Mapping[str, Component]]]:
    """Choices of causes of one joint, or of the base, with the places where their torques act.

    Of the base all of them, or those that are no momenta: both may be there.
    """
    base, of_base = fit.run.robot.base_link, [c.id in _OF_BASE for c in fit.causes]
    spots = [base if b else c.where for b, c in zip(of_base, fit.causes, strict=True)]
    for spot in dict.fromkeys(spots):
        every = enumerate(fit.causes)
        own = tuple(i for i, c in every if spots[i] == spot and c.id in PRICES)
        some = {p: it for p, it in places.items() if spot in (p, p.rpartition('/')[0])}
        torques = tuple(i for i in own if fit.causes[i].id not in _WHEELS)
        if torques and some:
            yield list(dict.fromkeys([own, torques])), some

"""Causes of a flight that stand for a law: the best that the catalogue has for it, and no more.

Viscous friction explains most of a drag, a constant torque most of one that follows the attitude.
The test of fit is of all that is left and does not see what they leave of it; the likelihood of
the law in their place does.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType

from ...estimation.fit import Fit
from .arm_channels import REPLACEABLE
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
_OF_BASE = {'external_torque_body': 0.0, 'external_torque_inertial': 3.0, 'gravity_gradient': 3.0}
PRICES: Mapping[str, float] = MappingProxyType({**_OF_JOINTS, **_OF_BASE})
"""Causes that are a form of the grammar, and their prices there [nats]."""


def instead_of(
    fit: Fit, places: Mapping[str, Component], *, is_refused: bool
) -> dict[int, Mapping[str, Component]]:
    """Numbers of the causes in whose place laws explain more, and the places of these laws.

    Fewer laws than causes, or one, ahead by all prices: of a model that fits as far as two causes
    are told apart, else as far as a law must be of chance. The same holds against the causes'
    forms as laws in that place: both comparisons have priors of their own, which friction of two
    numbers lost by 6.6 nats to a square root that as a law was ahead of it by 4.8.

    Args:
        fit: Of the causes.
        places: Where laws may be.
        is_refused: Whether it does not fit, so that laws beside its causes are asked, too.
    """
    out: dict[int, Mapping[str, Component]] = {}
    for own, some in _groups(fit, places):
        channel = FlightChannel(FlightRows(fit), some)
        other = FlightChannel(FlightRows(fit, own), some)
        beside = laws_of(channel)[0] if is_refused else []
        laws = laws_of(other)[0]
        price = sum(PRICES[fit.causes[i].id] for i in own)
        known = worth(channel, [it.step for it in beside]) - price
        beyond = worth(other, [it.step for it in laws]) - known
        is_other = 0 < len(laws) < max(len(own), 2) and not any(map(may_be_named, laws))
        if is_other and beyond > (MARGIN if is_refused else DEAD_HEAT):
            out |= dict.fromkeys(own, some)
    return out


def _groups(
    fit: Fit, places: Mapping[str, Component]
) -> Iterator[tuple[tuple[int, ...], Mapping[str, Component]]]:
    """Causes of one joint, or of the base, with the places where their torques act."""
    base, of_base = fit.run.robot.base_link, [c.id in _OF_BASE for c in fit.causes]
    spots = [base if b else c.where for b, c in zip(of_base, fit.causes, strict=True)]
    for spot in dict.fromkeys(spots):
        every = enumerate(fit.causes)
        own = tuple(i for i, c in every if spots[i] == spot and c.id in PRICES)
        some = {p: it for p, it in places.items() if spot in (p, p.rpartition('/')[0])}
        if own and some:
            yield own, some

"""Priors of effects on an arm: each that may be there has one, in the machine's own units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.joint import JointTorque
from spacerobot_ros.effects.parameter import amount
from spacerobot_ros.effects.prior import BodyScale, Scale
from spacerobot_ros.estimation.balance.arm_candidates import may_be_on_an_arm
from spacerobot_ros.model.uncertainty import USUAL

ON_ARMS = [kind for kind in CATALOGUE.values() if may_be_on_an_arm(kind)]
JOINT = Scale(
    sizes=np.ones(1),
    interval=0.01,
    gravity=np.array([0.0, 0.0, -9.81]),
    torque=10.0,
    needed=20.0,
    rate=0.5,
    acceleration=2.0,
    range=1.5,
    inertia=3.0,
    gain=0.08,
    dry=4.0,
    viscous=2.0,
)
ROW = np.array([2.0, 0.0, 0.0, 0.0, 0.12, 0.0, 0.12, 0.0, 0.0, 0.01])
LINK = BodyScale(
    row=ROW,
    uncertainty=USUAL,
    whole=20.0,
    length=0.5,
    is_last=False,
    is_lone=False,
)


@pytest.mark.parametrize('kind', ON_ARMS, ids=lambda kind: kind.id)
def test_what_may_be_on_an_arm_says_how_large_it_is(kind):
    assert kind.acts('prior')


class Own(JointTorque):
    """A user's."""

    id, title, is_own = 'own', 'a torque of a user', True
    parameters = (amount('torque', 'N m', 3.0),)


def test_a_user_s_own_has_its_parameters_sizes_and_is_not_there_otherwise():
    assert not Own.acts('prior')
    prior = Own.prior(replace(JOINT, sizes=np.array([3.0])))
    assert (prior.slab.tolist(), prior.spike.tolist(), prior.log_odds) == ([3.0], [0.0], 0.0)


@pytest.mark.parametrize('kind', [k for k in ON_ARMS if k.acts('prior')], ids=lambda kind: kind.id)
def test_torques_ten_times_as_large_have_sizes_ten_times_as_large(kind: type[Effect]):
    """Of what is a torque, or one by a rate, an angle or an acceleration; shares stay."""
    torques = ('torque', 'needed', 'inertia', 'dry', 'viscous')
    larger = replace(JOINT, **{name: 10.0 * getattr(JOINT, name) for name in torques})
    count = 2 if kind.id in ('joint_coupled_friction', 'joint_torque_ripple') else 1
    scales = [replace(scale, sizes=np.ones(count)) for scale in (JOINT, larger)]
    before, after = map(kind.prior, scales)
    if before is None or kind.id == 'gravity_error':
        return
    units = [p.unit for p in kind.parameters if p.role == 'linear']
    factor = 10.0 if units[0].startswith(('N', 'kg', 'A')) else 1.0
    np.testing.assert_allclose(after.slab, factor * before.slab)
    np.testing.assert_allclose(after.spike, factor * before.spike)


def test_nothing_of_an_angle_is_asked_where_only_rates_are_measured():
    blind = replace(JOINT, has_angle=False)
    nothing = {kind.id for kind in ON_ARMS if kind.id != 'inertial_parameters'}
    nothing = {k for k in nothing if CATALOGUE[k].prior(JOINT) and not CATALOGUE[k].prior(blind)}
    assert nothing == {
        'joint_torque_ripple',
        'joint_stiffness',
        'encoder_offset',
        'joint_presliding_friction',
    }


def test_a_link_is_uncertain_and_a_load_is_there_or_not():
    prior = CATALOGUE['inertial_parameters'].prior
    body = prior(replace(JOINT, sizes=np.ones(10), body=LINK))
    assert np.sqrt(body.spike[0, 0]) == pytest.approx(USUAL.mass * ROW[0])
    # half of it put there or lost, and all of it heavier or lighter by half
    assert body.slab[0, 0] == pytest.approx(2.0 * (0.5 * ROW[0]) ** 2)
    last = replace(LINK, is_last=True, uncertainty=None)
    load = prior(replace(JOINT, sizes=np.ones(10), body=last))
    assert not load.spike.any()
    assert load.slab[0, 0] == pytest.approx((0.1 * 20.0) ** 2 + (0.5 * ROW[0]) ** 2)
    assert np.all(np.linalg.eigvalsh(load.slab) > 0.0)

"""Laws fitted beside the causes that an arm's friction has: each keeps what is its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.arm_found import ArmFound
from spacerobot_ros.diagnosis.arms.fitted_arm import FittedArm
from spacerobot_ros.diagnosis.discovery.arm_motions import ArmMotions
from spacerobot_ros.diagnosis.discovery.discover import with_laws
from spacerobot_ros.diagnosis.discovery.law_candidate import candidate_of
from spacerobot_ros.diagnosis.discovery.possible_laws import SHAPE, Law
from spacerobot_ros.diagnosis.events.arm_events import ArmEvents
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.laws.grammar import FORMS
from spacerobot_ros.estimation.balance.arm_priors import DRY
from spacerobot_ros.estimation.balance.arm_priors import VISCOUS as SLIDING
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.real_arm import COULOMB, VISCOUS, RealArm, arm_file

JOINT, ASYMMETRY = 2, 4.0  # N m s/rad
GROWTH = 0.002  # of the load's square, 1/(N m)


@pytest.fixture(scope='module')
def found():
    """An arm's search that ends with both frictions of joint_3, whose file has none."""
    return found_with(DRY, SLIDING)


def asymmetric(rate, torque):
    return ASYMMETRY * np.abs(rate)


def found_with(*chosen, hidden=asymmetric):
    """The same with other frictions, and another torque beside them."""
    file = arm_file(has_friction=False)
    record = observed(RealArm(0, [], leftover=0.0).record(0, duration=12.0), file.robot)
    effort = record.effort.copy()
    rate = np.gradient(record.q[:, JOINT], record.joint_time)
    effort[:, JOINT] += hidden(rate, effort[:, JOINT])
    record = replace(record, joints=replace(record.joints, effort=effort))
    balances = [balance_of(record, file.robot, ())]
    kinds = dict.fromkeys([DRY, SLIDING, *chosen])
    rows = ArmRows.of(balances, [CATALOGUE[kind] for kind in kinds])
    levels = [np.array([0.01, *[1e-12] * 5])] * (2 * file.robot.n_joints)
    own = [i for i, c in enumerate(rows.candidates) if c.where == 'joint_3']
    first = {rows.candidates[i].kind.id: i for i in reversed(own)}
    fit = FittedArm.of(rows, levels, [first[kind] for kind in chosen])
    return ArmFound(
        records=(record,),
        robot=file.robot,
        believed=(),
        fit=fit,
        causes={},
        levels=np.array(levels),
        clear=fit.chosen,
        events=ArmEvents(left_out=((),)),
    )


def fitted_with(found, law):
    """Causes with a law of the joint, fitted together, and its number."""
    motions = ArmMotions(found.fit.rows, found.extended)
    candidate = candidate_of(law, JOINT, motions, found.fit.chosen)
    return with_laws(found, [candidate], motions.balances)


@pytest.mark.parametrize(('form', 'is_shape'), [('x', True), ('x*abs(x)', False)])
def test_a_law_that_a_cause_is_competes_and_is_none(found, form, is_shape):
    motions = ArmMotions(found.fit.rows, found.extended)
    law = Law(FORMS[form], ('rate/joint_3',), 0.0, 'friction', 'dissipative')
    candidate = candidate_of(law, JOINT, motions, found.fit.chosen)
    assert (candidate.of.kind == SHAPE) == is_shape


def test_friction_is_not_shared_out_with_a_law_that_has_its_terms(found):
    """Half of a Coulomb friction went to the law, with a deviation of ten times its size."""
    law = Law(FORMS['sign(x), x, abs(x)'], ('rate/joint_3',), 2.0, 'friction', 'friction')
    fitted, (number,) = fitted_with(found, law)
    named = {effect.id: next(iter(effect.values.values())) for effect in fitted.named}
    # the smoothing of its sign at reversals takes some of a dry friction
    assert named[DRY] == pytest.approx(COULOMB[JOINT], rel=0.03)
    assert named[SLIDING] == pytest.approx(VISCOUS[JOINT], rel=0.03)
    own = fitted.fit.rows.places[number]
    np.testing.assert_allclose(fitted.fit.values[own][:2], 0.0, atol=1e-3)
    assert abs(fitted.fit.values[own][2]) == pytest.approx(ASYMMETRY, rel=0.03)
    for i in found.clear:
        values = fitted.fit.values[fitted.fit.rows.places[i]]
        assert np.all(fitted.fit.spread(i) < 0.05 * np.abs(values))


def test_a_law_of_dry_friction_takes_nothing_of_a_friction_with_a_history():
    """One was 0.94 +- 0.07 N m where 0.52 was right: the law had taken the rest back."""
    history = 'joint_presliding_friction'
    searched = found_with(history, SLIDING)
    law = Law(FORMS['sign(x), x, abs(x)'], ('rate/joint_3',), 2.0, 'friction', 'friction')
    fitted, (number,) = fitted_with(searched, law)
    (at,) = (i for i in searched.fit.chosen if searched.fit.rows.candidates[i].kind.id == history)
    (value,), (spread,) = fitted.fit.values[fitted.fit.rows.places[at]], fitted.fit.spread(at)
    assert abs(value - COULOMB[JOINT]) < 2.0 * spread
    own = fitted.fit.rows.places[number]
    np.testing.assert_allclose(fitted.fit.values[own][:2], 0.0, atol=1e-3)


def test_a_law_of_the_load_goes_with_the_whole_torque_of_its_motor():
    """Of a file without friction the model's own load lacks it: half of the torque here."""
    searched = found_with(DRY, SLIDING, hidden=lambda rate, load: GROWTH * load**2 * np.sign(rate))
    searched = replace(searched, named=tuple(searched.fit.effects(searched.fit.chosen)))
    law = Law(
        FORMS['y**2*sign(x)'], ('rate/joint_3', 'load/joint_3'), 3.0, 'friction', 'dissipative'
    )
    fitted, (number,) = fitted_with(searched, law)
    (value,) = fitted.fit.values[fitted.fit.rows.places[number]]
    # friction that was found without the law has some of it
    assert value == pytest.approx(-GROWTH, rel=0.15)
